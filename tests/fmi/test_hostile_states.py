"""Saved states whose checksum was repaired after they had been changed: StateError, or a state that can be used."""

from __future__ import annotations

import json
import random
import struct
import time
import tracemalloc
import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from properties import share

from hybridsep.base.errors import HybridSepError, StateError
from hybridsep.base.settings import CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.state import VERSION
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.model.physics import ModalModel
from hybridsep.online.look_ahead import LookAhead
from hybridsep.predict.predictor import HybridPredictor

MODEL = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0, dead_time=2)
HOSTILE: list[Any] = [
    *(None, True, "", "x", [], {}, [[]], -1, 0, 1, 2, 7, 50, 2**31, 2**53 + 1, 2**63, 2**64, 10**30, 10**400),
    *(-0.5, 0.0, 1e-320, 1e-3, 1e99, 1e101, 1e308, float("nan"), float("inf"), float("-inf")),
]
NUMBERS = [0.0, -1.0, 1e-320, 1e9, 1e99, 1e101, 1e308, np.nan, np.inf, -np.inf]
EXAMPLES = share(600)
MEMORY_MAX = 300e6  # bytes, for a state of a few kilobytes
TIME_MAX = 20.0  # s


def sampled(look_ahead: LookAhead, count: int) -> None:
    for k in range(count):
        look_ahead.sample(1e-3 * np.sin(0.1 * k), 1e-3 * np.sin(0.1 * k - 0.3) + 1e-9 * (k % 3))


def small_predictor(**more: Any) -> HybridPredictor:
    return HybridPredictor(
        MODEL, PredictorSettings(**{"averaging": False, "Np": 8, "p": 3, "q": 2, "lam": 1e-8, "t_init": 0.0} | more)
    )


def small_compensator(**more: Any) -> SepCompensator:
    settings = CompensatorSettings(preview=24, limits=Limits(0.1, 16.0, 5000.0))
    return SepCompensator(small_predictor(**more), settings)


def use_predictor(predictor: HybridPredictor) -> None:
    for _ in range(3):
        predictor.predict(np.linspace(0, 1e-3, predictor.Np))
        predictor.update(np.linspace(0, 1e-3, predictor.Np))
    predictor.to_bytes()


def use_look_ahead(look_ahead: LookAhead) -> None:
    for _ in range(2):
        sampled(look_ahead, 12)
        names = ("x_d", "x_pb", "x_h", "x_h_std", "rms_pb", "rms_h", "rms_hold")
        outputs = [getattr(look_ahead, name) for name in names]
        assert np.isfinite(outputs).all()
    look_ahead.to_bytes()


def use_compensator(compensator: SepCompensator) -> None:
    for _ in range(2):
        plan = compensator.plan(np.linspace(0, 1e-3, compensator.preview))
        assert np.isfinite([plan.x_dm, plan.x_pb, plan.x_h]).all()
        compensator.update(plan.x_dm)
    compensator.to_bytes()


def predictor_state() -> bytes:
    predictor = small_predictor()
    use_predictor(predictor)
    predictor.predict(np.linspace(0, 1e-3, 8))
    return predictor.to_bytes()


def averaged_state() -> bytes:
    predictor = small_predictor(averaging=True)
    use_predictor(predictor)
    predictor.predict(np.linspace(0, 1e-3, 8))
    return predictor.to_bytes()


def look_ahead_state() -> bytes:
    look_ahead = LookAhead(small_predictor(), 0.0)
    sampled(look_ahead, 60)
    return look_ahead.to_bytes()


def sep_look_ahead_state() -> bytes:
    look_ahead = LookAhead(small_compensator(), 0.0)
    sampled(look_ahead, 90)
    return look_ahead.to_bytes()


def compensator_state() -> bytes:
    compensator = small_compensator()
    use_compensator(compensator)
    compensator.plan(np.linspace(0, 1e-3, compensator.preview))
    return compensator.to_bytes()


def averaged_compensator_state() -> bytes:
    compensator = small_compensator(averaging=True)
    use_compensator(compensator)
    compensator.plan(np.linspace(0, 1e-3, compensator.preview))
    return compensator.to_bytes()


STATES: dict[str, tuple[Callable[[], bytes], Callable[[bytes], Any], Callable[[Any], None]]] = {
    "predictor": (predictor_state, HybridPredictor.from_bytes, use_predictor),
    "predictor with averaging": (averaged_state, HybridPredictor.from_bytes, use_predictor),
    "look-ahead": (look_ahead_state, partial(LookAhead.from_bytes, model_type=HybridPredictor), use_look_ahead),
    "compensator": (compensator_state, SepCompensator.from_bytes, use_compensator),
    "compensator with averaging": (averaged_compensator_state, SepCompensator.from_bytes, use_compensator),
    "look-ahead of a compensator": (
        sep_look_ahead_state,
        partial(LookAhead.from_bytes, model_type=SepCompensator),
        use_look_ahead,
    ),
}


def sealed(header: bytes, body: bytes) -> bytes:
    blob = struct.pack("<4sII", b"HSEP", VERSION, len(header)) + header + body
    return blob + struct.pack("<I", zlib.crc32(blob))


def opened(blob: bytes) -> tuple[dict[str, Any], bytes]:
    _, _, length = struct.unpack_from("<4sII", blob)
    return json.loads(blob[12 : 12 + length]), blob[12 + length : -4]


def mutated(blob: bytes, chance: random.Random) -> bytes:
    """Change a state in one place, or one of its parts, and repair every checksum."""
    header, body = opened(blob)
    if header["parts"] and chance.random() < 0.7:
        place = sum(8 * int(np.prod(shape)) for _, shape in header["arrays"])
        part = mutated(body[place:], chance)
        header["parts"][0][1] = len(part)
        return sealed(json.dumps(header).encode(), body[:place] + part)
    kind = chance.randrange(6)
    if kind == 0:
        table = header["meta"]
        if "settings" in table and chance.random() < 0.5:
            table = table["settings"]
        table[chance.choice(list(table))] = chance.choice(HOSTILE)
    elif kind == 1:
        del header["meta"][chance.choice(list(header["meta"]))]
    elif kind == 2:
        array = chance.choice(header["arrays"])
        array[chance.randrange(2)] = chance.choice([*HOSTILE, [chance.choice(HOSTILE)], [0, 2**40], [2**62, 4], [-1]])
    elif kind == 3:
        del header["arrays"][chance.randrange(len(header["arrays"]))]
    elif kind == 4:
        place = 8 * chance.randrange(len(body) // 8)
        body = body[:place] + struct.pack("<d", chance.choice(NUMBERS)) + body[place + 8 :]
    else:
        name = chance.choice(["kind", "meta", "arrays", "parts"])
        header[name] = chance.choice(HOSTILE)
    return sealed(json.dumps(header).encode(), body)


@pytest.mark.slow
@pytest.mark.parametrize("kind", STATES)
def test_a_changed_state_with_a_right_checksum(kind: str) -> None:
    make, restore, use = STATES[kind]
    blob, chance = make(), random.Random(kind)
    use(restore(blob))
    messages: list[str] = []
    tracemalloc.start()
    try:
        for _ in range(EXAMPLES):
            changed, begin = mutated(blob, chance), time.perf_counter()
            try:
                restored = restore(changed)
            except StateError as error:
                messages.append(str(error))
                continue
            try:
                with np.errstate(all="ignore"):
                    use(restored)
            except HybridSepError:
                pass
            assert time.perf_counter() - begin < TIME_MAX
        assert tracemalloc.get_traced_memory()[1] < MEMORY_MAX
    finally:
        tracemalloc.stop()
    assert 0.4 * EXAMPLES < len(messages) < EXAMPLES
    assert max(map(len, messages)) < 400


@pytest.mark.slow
def test_what_is_allocated_follows_from_the_size_of_the_state() -> None:
    header, body = opened(predictor_state())
    tracemalloc.start()
    try:
        for changes in ({"Np": 100_000, "p": 5000, "q": 5000}, {"dead_time": 10**9}, {"Np": 10**12}):
            meta = header["meta"]
            inside = {name: value for name, value in changes.items() if name in meta["settings"]}
            meta = {**meta, **changes, "settings": {**meta["settings"], **inside}}
            changed = {**header, "meta": {name: meta[name] for name in header["meta"]}}
            with pytest.raises(StateError, match="the saved predictor is inconsistent"):
                HybridPredictor.from_bytes(sealed(json.dumps(changed).encode(), body))
        modes = {**header, "arrays": [["modes", [50_000, 4]], *(a for a in header["arrays"] if a[0] != "modes")]}
        many = np.tile([25.0, 0.05, 24674.0, 15.7], 50_000).tobytes() + body[32:]
        with pytest.raises(StateError, match="at most 100 modes, got 50000"):
            HybridPredictor.from_bytes(sealed(json.dumps(modes).encode(), many))
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()
