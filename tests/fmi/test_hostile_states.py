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


def sampled(look_ahead: LookAhead, count: int = 24) -> None:
    """Step, and read what is shown."""
    for k in range(count):
        look_ahead.sample(1e-3 * np.sin(0.1 * k), 1e-3 * np.sin(0.1 * k - 0.3) + 1e-9 * (k % 3))
    names = ("x_d", "x_pb", "x_h", "x_h_std", "rms_pb", "rms_h", "rms_hold")
    assert np.isfinite([getattr(look_ahead, name) for name in names]).all()
    look_ahead.to_bytes()


def predictor(**more: Any) -> HybridPredictor:
    given = {"averaging": False, "Np": 8, "p": 3, "q": 2, "lam": 1e-8, "t_init": 0.0, **more}
    return HybridPredictor(MODEL, PredictorSettings(**given))


def use(predictor: HybridPredictor) -> None:
    for _ in range(3):
        predictor.predict(np.linspace(0, 1e-3, predictor.Np))
        predictor.update(np.linspace(0, 1e-3, predictor.Np))
    predictor.to_bytes()


def predictor_state(**more: Any) -> bytes:
    """Return a predictor's state in the middle of a window."""
    learned = predictor(**more)
    use(learned)
    learned.predict(np.linspace(0, 1e-3, 8))
    return learned.to_bytes()


def look_ahead_state(averaging: bool) -> bytes:
    """Return the state of a compensator's look-ahead, in which it, a plan and its predictor are."""
    settings = CompensatorSettings(preview=24, limits=Limits(0.1, 16.0, 5000.0))
    look_ahead = LookAhead(SepCompensator(predictor(averaging=averaging), settings), 0.0)
    sampled(look_ahead, 90)
    return look_ahead.to_bytes()


of_compensator = partial(LookAhead.from_bytes, model_type=SepCompensator)
STATES: dict[str, tuple[Callable[[], bytes], Callable[[bytes], Any], Callable[[Any], None]]] = {
    "predictor": (predictor_state, HybridPredictor.from_bytes, use),
    "predictor with averaging": (partial(predictor_state, averaging=True), HybridPredictor.from_bytes, use),
    "look-ahead": (partial(look_ahead_state, False), of_compensator, sampled),
    "look-ahead with averaging": (partial(look_ahead_state, True), of_compensator, sampled),
}


def sealed(header: dict[str, Any], body: bytes) -> bytes:
    text = json.dumps(header).encode()
    blob = struct.pack("<4sII", b"HSEP", VERSION, len(text)) + text + body
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
        return sealed(header, body[:place] + part)
    kind = chance.randrange(6)
    if kind == 0:
        table = header["meta"]
        if "settings" in table and chance.random() < 0.5:
            table = table["settings"]
        table[chance.choice(list(table))] = chance.choice(HOSTILE)
    elif kind == 1:
        del header["meta"][chance.choice(list(header["meta"]))]
    elif kind == 2 and header["arrays"]:
        array = chance.choice(header["arrays"])
        array[chance.randrange(2)] = chance.choice([*HOSTILE, [chance.choice(HOSTILE)], [0, 2**40], [2**62, 4], [-1]])
    elif kind == 3 and header["arrays"]:
        del header["arrays"][chance.randrange(len(header["arrays"]))]
    elif kind == 4 and len(body) >= 8:
        place = 8 * chance.randrange(len(body) // 8)
        body = body[:place] + struct.pack("<d", chance.choice(NUMBERS)) + body[place + 8 :]
    else:
        header[chance.choice(["kind", "meta", "arrays", "parts"])] = chance.choice(HOSTILE)
    return sealed(header, body)


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


def test_what_is_allocated_follows_from_the_size_of_the_state() -> None:
    header, body = opened(predictor_state())
    tracemalloc.start()
    try:
        for changes in ({"Np": 100_000, "p": 5000, "q": 5000}, {"dead_time": 10**9}, {"Np": 10**12}):
            meta = header["meta"]
            settings = {name: changes.get(name, value) for name, value in meta["settings"].items()}
            meta = {name: changes.get(name, value) for name, value in meta.items()} | {"settings": settings}
            with pytest.raises(StateError, match="the saved predictor is inconsistent"):
                HybridPredictor.from_bytes(sealed({**header, "meta": meta}, body))
        modes = [["modes", [50_000, 4]], *(a for a in header["arrays"] if a[0] != "modes")]
        many = np.tile([25.0, 0.05, 24674.0, 15.7], 50_000).tobytes() + body[32:]
        with pytest.raises(StateError, match="at most 100 modes, got 50000"):
            HybridPredictor.from_bytes(sealed({**header, "arrays": modes}, many))
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()
