"""What every implementation shows, against windows that are computed one by one from the whole log."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from driving import SHORT, closed_loop, replay, run
from library_stream import library_compensator, start_values
from numpy.typing import NDArray
from oracle import held
from staircase_data import TS, commanded
from stream import COMPENSATOR, LIBRARY, LOOK_AHEADS, OUTPUTS, PREDICTOR, Array, Value, machine_of
from streams import StreamMaker, on_adapters, on_all

from hybridsep import backtest
from hybridsep.plants.plant import Encoder, simulate


def shown_by(new_stream: StreamMaker, n: int, values: dict[str, Value], start: float = 0.0) -> dict[str, np.ndarray]:
    """Return the inputs of a closed loop of the library and what a stream shows of it."""
    loop, stream = closed_loop(new_stream.model, n, values, start=start), new_stream()
    stream.initialise(loop.values)
    return dict(zip(OUTPUTS[new_stream.model], replay(stream, loop).T, strict=True)) | {"r": loop.r, "x_meas": loop.x}


PLANS: dict[str, Value] = {"Np": 50, "p": 20, "q": 3, "t_init": 0.1, "preview": 170}


@cache
def predicted() -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return ``x_pb``, ``x_h`` and whether that is the hybrid one, of the closed loop's log, window by window."""
    loop = closed_loop(PREDICTOR, 1700, {}, start=0.1)
    result = backtest(machine_of("HybridPredictor").new_predictor(), loop.r[:-100], loop.x[100:])
    return result.x_pb, result.x_h, result.active


@cache
def planned() -> dict[str, Array]:
    """Return what the library plans of the closed loop's log, window by window."""
    loop = closed_loop(COMPENSATOR, 900, PLANS, start=0.1)
    given: dict[str, Any] = {**start_values(COMPENSATOR), **PLANS}
    compensator, preview, Np = library_compensator(given), given["preview"], given["Np"]
    compensator.restart(float(loop.r[0]), t_init=given["t_init"], lead_in=preview)
    x_d, windows = np.concatenate((np.full(preview, loop.r[0]), loop.r)), []
    for k in range(0, len(loop.r), Np):
        plan = compensator.plan(x_d[k : k + preview])
        state = np.where(np.arange(Np) < plan.n_followed, plan.state_before, plan.state)
        windows.append((plan.x_dm, x_d[k : k + Np], plan.x_pb, plan.x_h, state))
        compensator.update(loop.x[k : k + Np])
    return dict(zip(("x_dm", "x_d", "x_pb", "x_h", "sep_state"), np.hstack(windows), strict=True))


def tolerance_of(new_stream: StreamMaker) -> float:
    return 1e-16 if new_stream.implementation == LIBRARY else 1e-11


@on_all((PREDICTOR,))
def test_predictions_are_those_of_the_delayed_log(new_stream: StreamMaker) -> None:
    shown = shown_by(new_stream, 1700, {}, 0.1)
    x_pb, x_h, active = predicted()
    n, tolerance = len(x_pb), tolerance_of(new_stream)
    np.testing.assert_array_equal(shown["x_d"][100 : 100 + n], shown["r"][:n])
    np.testing.assert_allclose(shown["x_pb"][100 : 100 + n], x_pb, rtol=0, atol=tolerance)
    np.testing.assert_allclose(shown["x_h"][100 : 100 + n], x_h, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(shown["hybrid_active"][100 : 100 + n] == 1.0, active)


@pytest.mark.slow
@on_all((COMPENSATOR,))
def test_commands_are_those_of_plans_made_window_by_window(new_stream: StreamMaker) -> None:
    shown = shown_by(new_stream, 900, PLANS, 0.1)
    expected = planned()
    exact = new_stream.implementation == LIBRARY
    for name in ("x_dm", "x_d", "x_pb", "x_h", "sep_state"):
        np.testing.assert_allclose(shown[name][:900], expected[name], rtol=0, atol=0 if exact else 1e-9, err_msg=name)
    assert set(expected["sep_state"]) == {1, 2}


@on_all((PREDICTOR,))
def test_the_first_fill_keeps_the_drive_at_its_start_and_is_not_learned(new_stream: StreamMaker) -> None:
    streams = [new_stream.begun(x_d_ahead=0.25) for _ in range(2)]
    for stream, x_meas in zip(streams, (17.0, 0.25), strict=True):
        for k in range(20):
            stream.set("x_d_ahead", 0.3)
            stream.set("x_meas", x_meas)
            assert stream.outputs() == [0.25, 0.25, 0.25, *[0.0] * 8], k
            stream.step(k * TS, TS)
        assert stream.outputs()[0] == 0.3
        for k in range(20, 100):
            stream.set("x_meas", 0.26 + 1e-4 * math.sin(k))
            stream.step(k * TS, TS)
    first, second = (stream.outputs() for stream in streams)
    assert first == second
    assert first[OUTPUTS[PREDICTOR].index("hybrid_active")] == 1.0


@on_all((PREDICTOR,))
@pytest.mark.parametrize(("Np", "n"), [(20, 500), (40, 120), (100, 400), (150, 450)])
def test_windows_show_the_batch(new_stream: StreamMaker, Np: int, n: int) -> None:
    # Of a smaller Np than built with, zeros follow; of a larger one the first samples are shown.
    values: dict[str, Value] = {"Np": Np, "p": 10, "q": 2, "t_init": 0.0}
    loop, stream = closed_loop(PREDICTOR, n + Np, values), new_stream()
    stream.initialise(loop.values)
    replay(stream, loop, 0, n)
    assert stream.outputs()[OUTPUTS[PREDICTOR].index("batch")] == n // Np
    length = min(Np, 100)
    for name in ("x_d", "x_pb", "x_h"):
        expected = np.zeros(100)
        expected[:length] = loop.column(PREDICTOR, name)[n : n + length]
        np.testing.assert_allclose(stream.window(f"{name}_window"), expected, rtol=0, atol=tolerance_of(new_stream))
    np.testing.assert_array_equal(stream.window("x_d_window")[:length], loop.r[n - Np : n - Np + length])


@on_adapters((PREDICTOR,))
def test_a_window_is_whole_when_it_begins_and_reading_it_changes_nothing(new_stream: StreamMaker) -> None:
    """With averaging, whose predictions are made in parts."""
    values: dict[str, Value] = {"Np": 60, "p": 10, "t_init": 0.0, "averaging": True}
    loop, stream, other = closed_loop(PREDICTOR, 420, values), new_stream(), new_stream()
    stream.initialise(loop.values)
    other.initialise(loop.values)
    expected = replay(other, loop, 0, 420)
    for first in range(0, 420, 60):
        for name in ("x_d", "x_pb", "x_h", "x_h_std"):
            column = expected[first : first + 60, OUTPUTS[PREDICTOR].index(name)]
            np.testing.assert_array_equal(stream.window(f"{name}_window")[:60], column)
        np.testing.assert_array_equal(replay(stream, loop, first, first + 60), expected[first : first + 61])


@on_all(LOOK_AHEADS)
def test_the_warm_up_counts_from_the_end_of_the_fill(new_stream: StreamMaker) -> None:
    # A plan with averaging acts 24 samples after its window begins.
    name, hybrid, fill = ("hybrid_active", 1.0, 100) if new_stream.model == PREDICTOR else ("sep_state", 2.0, 224)
    shown = shown_by(new_stream, 700, {"t_init": 0.3})
    assert np.flatnonzero(shown[name] == hybrid)[0] == fill + 300


@on_all((COMPENSATOR,))
def test_a_move_in_sight_is_prepared_in_the_fill_which_is_not_learned(new_stream: StreamMaker) -> None:
    values = SHORT[COMPENSATOR]
    loop = closed_loop(COMPENSATOR, 300, values)
    runs = []
    for fill in (loop.x, np.where(np.arange(300) < 60, 1e-4 * np.sin(np.arange(300)), loop.x)):
        stream = new_stream()
        stream.initialise(loop.values)
        runs.append(replay(stream, type(loop)(loop.values, loop.r, fill, loop.outputs)))
    x_dm, x_d = runs[0].T[:2]
    np.testing.assert_array_equal(x_d[:60], 0.0)
    assert not x_dm[:20].any()  # nothing was in sight yet
    assert x_dm[20:60].any()
    state = OUTPUTS[COMPENSATOR].index("sep_state")
    assert runs[0][:, state].max() == 2.0
    # What was measured over the fill is in no weight and no error; its last residual tells how uncertain x_h is. The
    # window after it is learned.
    first, second = (np.delete(run[:61], OUTPUTS[COMPENSATOR].index("x_h_std"), axis=1) for run in runs)
    np.testing.assert_array_equal(first, second)


@pytest.mark.slow
@on_all(LOOK_AHEADS)
def test_running_rms_counts_from_the_warm_up(new_stream: StreamMaker) -> None:
    t_init = 0.25
    shown = shown_by(new_stream, 1000, {"t_init": t_init})
    fill, Np = (100, 100) if new_stream.model == PREDICTOR else (200, 50)
    first = fill + round(t_init / TS)
    sums = {"rms_pb": shown["x_pb"], "rms_h": shown["x_h"]}
    if new_stream.model == COMPENSATOR:
        sums["rms_e"] = shown["x_d"]
    for name, against in sums.items():
        assert not shown[name][: first + 1].any()
        for k in (first, first + 1, first + 400, 999):
            expected = math.sqrt(np.mean((shown["x_meas"][first : k + 1] - against[first : k + 1]) ** 2))
            assert shown[name][k + 1] == pytest.approx(expected, rel=1e-9)
    assert shown["rms_h"][-1] < shown["rms_pb"][-1]
    np.testing.assert_array_equal(shown["batch"], np.arange(1001) // Np)


N, FIRST = 1400, 1060
"""Samples, and the sample of the staircase where they begin: in the middle of a move, so the start is corrected."""


def disturbed(model: str, delay: int, *, missing: bool) -> tuple[Array, Array]:
    """Return commands and late measurements that stand, change their level, and are missing for a while, (n,), m."""
    x_d = commanded()[: FIRST + N]
    x = Encoder(1e-7, 5).measure_all(simulate(machine_of(model).new_plant(), x_d, TS))
    x_d, x = x_d[FIRST:].copy(), np.concatenate((np.full(delay, x[FIRST]), x))[FIRST : FIRST + N].copy()
    x[250:590] = x[250]  # the axis stands while the command moves
    x[700:] += 3e-4  # the level changes, which is not believed at first
    x[739::100] += 1e-3  # at the end of windows, of other lengths too
    if missing:
        x[830:955] = np.nan
        x[1099] = np.nan
    return x_d, x


@pytest.mark.slow
@on_all((PREDICTOR, COMPENSATOR), alike=(LIBRARY,))  # the C core agrees with the library in every output
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"t_init": 0.333},
        {"measurement_delay": 45},  # later than a window
        {"averaging": False, "t_init": 0.2},
    ],
    ids=lambda more: ",".join(f"{key}={value}" for key, value in more.items()) or "averaging",
)
def test_hold_is_the_residual_of_the_last_sample_measured(new_stream: StreamMaker, more: dict[str, Value]) -> None:
    values: dict[str, Value] = {"Np": 20, "p": 6, "q": 2, "averaging": True, "t_init": 0.0} | more
    fill, delay = 20, int(values.get("measurement_delay", 0))
    if new_stream.model == COMPENSATOR:
        fill = 50  # which ends within a window
        values |= {"preview": fill, "compensate": 2}
    x_d, x = disturbed(new_stream.model, delay, missing=bool(values["averaging"]))
    shown = run(new_stream(), x_d, x, values, saved_at=437)
    x_pb, rms_hold = (shown.T[OUTPUTS[new_stream.model].index(name)] for name in ("x_pb", "rms_hold"))
    measured, n = x[delay:], N - delay
    error = measured - held(x_pb[:n], measured, 20, delay=delay, first=fill)
    begin = fill + round(float(values["t_init"]) / TS)
    assert not rms_hold[: begin + delay + 1].any()
    for k in (begin, begin + 1, 400, 600, 745, 900, n - 1):
        known = error[begin : k + 1][~np.isnan(error[begin : k + 1])]
        assert rms_hold[k + delay + 1] == pytest.approx(np.sqrt(np.mean(known**2)), rel=0, abs=1e-12), k
    assert rms_hold[-1] > 1e-5
