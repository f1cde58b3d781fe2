"""A saved state is read back exactly, or refused: damaged, truncated, foreign, of another kind or version."""

import struct
import zlib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from properties import examples

from hybridsep.base.errors import StateError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.state import VERSION, pack, unpack
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor

META: dict[str, Any] = {"k": 7, "T_s": 1e-3, "start": None, "input_hold": "zoh"}
PARTS = {"inner": b"\x00HSEP\xff", "nothing": b""}
BLOB = pack("test", META, {"a": np.arange(6.0).reshape(2, 3), "empty": np.empty(0)}, PARTS)


def predictor_blob() -> bytes:
    predictor = HybridPredictor(
        ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), PredictorSettings(averaging=False, Np=5, p=2, q=1)
    )
    predictor.predict(np.linspace(0.1, 0.2, 5))
    predictor.update(np.linspace(0.1, 0.21, 5))
    predictor.predict(np.linspace(0.2, 0.3, 5))
    return predictor.to_bytes()


PREDICTOR = predictor_blob()


@examples(40)
@given(
    values=st.dictionaries(
        st.text(max_size=5),
        arrays(np.float64, array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)),
        max_size=3,
    )
)
def test_arrays_come_back_bit_for_bit(values: dict[str, Any]) -> None:
    meta, back, parts = unpack("test", pack("test", META, values))
    assert parts == {}
    assert meta == META
    assert list(back) == list(values)
    for name, array in values.items():
        assert back[name].shape == array.shape
        assert back[name].tobytes() == array.tobytes()
        assert back[name].flags.writeable


def test_the_same_state_gives_the_same_bytes() -> None:
    meta, values, parts = unpack("test", BLOB)
    assert parts == PARTS
    assert pack("test", dict(reversed(meta.items())), values, parts) == BLOB


def test_truncated_at_any_byte() -> None:
    for end in range(len(PREDICTOR)):
        with pytest.raises(StateError):
            HybridPredictor.from_bytes(PREDICTOR[:end])


@examples(400)
@given(position=st.integers(0, len(PREDICTOR) - 1), flip=st.integers(1, 255))
def test_a_flipped_byte(position: int, flip: int) -> None:
    damaged = bytearray(PREDICTOR)
    damaged[position] ^= flip
    with pytest.raises(StateError):
        HybridPredictor.from_bytes(damaged)


@given(st.binary(max_size=200))
def test_foreign_bytes(blob: bytes) -> None:
    with pytest.raises(StateError, match=f"^a saved state of kind 'test' was expected, got {len(blob)} bytes of"):
        unpack("test", blob)


def test_another_kind() -> None:
    with pytest.raises(StateError, match=r"^a saved state of kind 'predictor' was expected, got one of kind 'test'$"):
        HybridPredictor.from_bytes(BLOB)


@pytest.mark.parametrize("version", [0, VERSION + 1, 2**32 - 1])
def test_another_version(version: int) -> None:
    other = BLOB[:4] + struct.pack("<I", version) + BLOB[8:-4]
    with pytest.raises(StateError, match=f"has format version {version}, this library reads {VERSION}"):
        unpack("test", other + struct.pack("<I", zlib.crc32(other)))  # else it would pass for damaged


@pytest.mark.parametrize(
    "change",
    [
        {"dead_time": []},
        {"modes": -np.ones((1, 4))},
        {"residual.regression.factor": np.eye(2)},
        {"residual.e_pb": None},
    ],
    ids=str,
)
def test_a_predictor_of_another_build(change: dict[str, Any]) -> None:
    meta, values, _ = unpack("predictor", PREDICTOR)
    for name, value in change.items():
        if name in meta:
            meta[name] = value
        elif value is None:
            del values[name]
        else:
            values[name] = value
    with pytest.raises(StateError, match=r"^the saved predictor is of another build of the library, train again: "):
        HybridPredictor.from_bytes(pack("predictor", meta, values))
