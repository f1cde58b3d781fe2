"""Saved states, on every implementation: a run from one is the same to the last bit, wherever it goes on."""

import math
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from built_once import BuiltFmus
from driving import SHORT, T_S, TIGHT, initialise, set_inputs, steps
from stream import (
    CANNOT,
    COMPENSATOR,
    FMI3,
    LIBRARY,
    LOOK_AHEADS,
    MODELS,
    NATIVE,
    PREDICTOR,
    RefusedStreamError,
    Stream,
    Value,
)
from streams import StreamMaker, on_adapters

N_SAMPLES = 200

every = on_adapters(MODELS)


class Times:
    """Communication points at random places in the samples and between them; the same for every run."""

    def __init__(self, *, missing: bool) -> None:
        self.missing = missing  # whether some measurements are
        sizes = np.random.default_rng(5).choice([0.25, 0.5, 1.0, 1.0, 1.0, 3.75], 2 * N_SAMPLES)
        self.points = np.concatenate(([0.0], np.cumsum(sizes)))
        self.n = int(np.searchsorted(self.points, N_SAMPLES))

    def run(self, stream: Stream, first: int, last: int) -> list[list[float]]:
        outputs = []
        for begin, end in zip(self.points[first:last], self.points[first + 1 : last + 1], strict=True):
            set_inputs(stream, float(begin) * T_S)
            if self.missing and int(begin) % 9 < 3:
                stream.set("x_meas", math.nan)
            stream.step(float(begin) * T_S, float(end - begin) * T_S)
            outputs.append(stream.outputs())
        return outputs


def assert_exact(new_stream: StreamMaker, values: dict[str, Value], *, missing: bool = False) -> None:
    """Go back to random times again and again, within windows and within samples."""
    rng, times = np.random.default_rng(7), Times(missing=missing)
    stream, whole = new_stream(), new_stream()
    for each in (stream, whole):
        each.initialise(values)
    expected = times.run(whole, 0, times.n)
    i = 0
    while i < times.n:
        ahead = min(times.n, i + int(rng.integers(1, 60)))
        blob = stream.save()
        assert times.run(stream, i, ahead) == expected[i:ahead]
        after = stream.save()
        stream.restore(blob)
        assert stream.save() == blob
        assert times.run(stream, i, ahead) == expected[i:ahead]
        assert stream.save() == after
        i = ahead
    assert stream.save() == whole.save()


@every
def test_rollback_is_exact(new_stream: StreamMaker) -> None:
    assert_exact(new_stream, {})


@on_adapters(LOOK_AHEADS)
@pytest.mark.parametrize(
    ("values", "missing"),
    [({"measurement_delay": -1}, False), ({"averaging": True, "forgetting": 0.3}, True)],
    ids=["short windows", "averaging and missing measurements"],
)
def test_a_look_aheads_rollback_is_exact(new_stream: StreamMaker, values: dict[str, Value], missing: bool) -> None:
    assert_exact(new_stream, SHORT[new_stream.model] | values, missing=missing)


@on_adapters((COMPENSATOR,))
@pytest.mark.parametrize("values", [{}, {"averaging": True, "measurement_delay": 35}], ids=["bounded", "late"])
def test_rollback_is_exact_while_a_plan_is_solved(new_stream: StreamMaker, values: dict[str, Value]) -> None:
    # It is there 8 samples after its window has begun.
    assert_exact(new_stream, SHORT[COMPENSATOR] | TIGHT | values)


@pytest.mark.slow
@every
@pytest.mark.parametrize("cut", [1, 57])
def test_a_state_goes_on_in_a_second_instance(new_stream: StreamMaker, cut: int) -> None:
    first, second = new_stream(), new_stream()
    initialise(first, **({"p": 5} if new_stream.model in LOOK_AHEADS else {}))
    steps(first, 0, cut)
    blob = first.save()
    if new_stream.implementation == FMI3 and new_stream.model == PREDICTOR:  # the size of its arrays goes before
        initialise(second)
    second.restore(blob)  # with parameters of its own, and not even initialised
    assert second.save() == blob
    assert steps(second, cut, cut + 120) == steps(first, cut, cut + 120)
    assert second.save() == first.save()


@on_adapters(LOOK_AHEADS)
def test_a_state_of_the_other_model_goes_on_in_a_second_instance(new_stream: StreamMaker) -> None:
    first, second = new_stream(), new_stream()
    initialise(first, averaging=new_stream.model == PREDICTOR)  # which the second one has not, by its machine file
    steps(first, 0, 155)
    blob = first.save()
    if new_stream.implementation == FMI3:
        initialise(second)
    second.restore(blob)
    assert second.save() == blob
    assert steps(second, 155, 300) == steps(first, 155, 300)


def go_on(name: str, folder: Path, fmus: Path) -> list[list[float]]:
    """Return the outputs of a stream that goes on from the state in a file of this name: implementation and model."""
    implementation, _, model = name.rpartition(" ")
    maker = StreamMaker(implementation, model, BuiltFmus(fmus), folder)
    stream = maker()
    stream.restore((folder / name).read_bytes())
    outputs = steps(stream, 250, 400)
    maker.close()
    return outputs


@pytest.mark.slow
def test_states_go_on_in_another_process(fmus: BuiltFmus, tmp_path: Path) -> None:
    """Of library and native FMUs; the others save the same."""
    expected = {}
    for implementation in (LIBRARY, NATIVE):
        maker = StreamMaker(implementation, "", fmus, tmp_path)
        for model in MODELS:
            if (implementation, model) not in CANNOT:
                stream = maker(model)
                initialise(stream)
                steps(stream, 0, 250)
                (tmp_path / f"{implementation} {model}").write_bytes(stream.save())
                expected[f"{implementation} {model}"] = steps(stream, 250, 400)
        maker.close()
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        for name, outputs in expected.items():
            assert pool.submit(go_on, name, tmp_path, fmus.folder).result() == outputs


@on_adapters(MODELS, needs="bad states")
def test_damaged_and_truncated_states_are_refused(new_stream: StreamMaker) -> None:
    stream = new_stream.begun()
    steps(stream, 0, 130)
    blob = stream.save()
    damaged = [bytes((*blob[:i], blob[i] ^ 0x10, *blob[i + 1 :])) for i in range(0, len(blob), 1 + len(blob) // 60)]
    for bad in (*damaged, b"", blob[:100], blob[:-4], bytes(len(blob)), blob + b"\0"):
        with pytest.raises(RefusedStreamError):
            stream.restore(bad)
        assert stream.save() == blob


@on_adapters(LOOK_AHEADS, needs="bad states")
def test_states_of_other_models_are_refused(new_stream: StreamMaker) -> None:
    stream = new_stream.begun()
    before = stream.save()
    other = new_stream(next(model for model in LOOK_AHEADS if model != new_stream.model))
    other.initialise({})
    with pytest.raises(RefusedStreamError):
        stream.restore(other.save())
    assert stream.save() == before
