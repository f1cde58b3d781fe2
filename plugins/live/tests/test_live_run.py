"""Native core on a stream: equal to a co-simulation, and to a replay."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from built_once import BuiltFmus
from command_line import write_rows
from live_runs import Kept, Listed
from staircase_data import commanded

from hybridsep import backtest, load_machine
from hybridsep.base.errors import FmuError, ParameterError, SignalError
from hybridsep.cosim.loop import FmuController, cosimulate
from hybridsep.cosim.run import Run
from hybridsep.fmi.weights import warm_predictor
from hybridsep.logs.log import read_log
from hybridsep_live.core import Row, StepTimes
from hybridsep_live.run import LiveRun, run_live
from hybridsep_live.sample import Sample
from hybridsep_live.sources import RecordedSource

NP = 100
SIGNALS = ("t", "x_d", "x_meas", "x_pb", "x_h", "x_h_std", "active")


class Case(NamedTuple):
    """A co-simulation of the native predictor and a drive, whose fourth window has no measurement.

    ``arrived`` has the measured positions as they arrived.
    """

    run: Run
    late: int
    arrived: list[float]


@pytest.fixture(scope="module", params=[0, 3])
def case(request: pytest.FixtureRequest, fmus: BuiltFmus) -> Case:
    late, measured = int(request.param), []

    def sensor(k: int, x: float) -> float:
        found = math.nan if 300 <= k < 400 else x
        if k >= -late:
            measured.append(found)
        return found

    run = cosimulate(
        fmus("HybridPredictor"),
        fmus("FeedDrive"),
        commanded()[:2500],
        controller_values={"measurement_delay": late},
        sensor=sensor,
    )
    return Case(run, late, measured[:2500])


def live(fmu: Path, samples: list[Sample | None], **values: object) -> tuple[Kept, LiveRun]:
    kept = Kept()
    found = run_live(Listed(samples), FmuController(fmu, values), [kept])
    assert found.n_rows == len(kept.rows)
    return kept, found


def equal(rows: list[Row], run: Run, late: int) -> bool:
    n = len(run.t) - late
    assert len(rows) == n
    assert [row.k for row in rows] == list(range(n))
    return all(
        np.array_equal([getattr(row, name) for row in rows], getattr(run, name)[:n], equal_nan=True)
        for name in SIGNALS[1:]
    )


def test_commands_of_now_give_what_the_cosimulation_gave(fmus: BuiltFmus, case: Case) -> None:
    run, late, arrived = case
    samples = [Sample(*pair) for pair in zip(run.x_d.tolist(), arrived, strict=True)]
    kept, found = live(fmus("HybridPredictor"), [*samples, None], measurement_delay=late)
    assert equal(kept.rows, run, late)
    assert kept.begun == (1e-3, NP)
    assert kept.ends == [""]
    assert kept.status == found.status
    assert found.status["n_samples"] == 2500
    assert found.status["n_missing"] == 100
    assert found.status["n_rejected"] == run.n_rejected
    assert found.status["rms_h"] > 0.0
    assert 0.0 < found.status["step_p50"] <= found.status["step_p99"] <= found.status["step_max"]


def test_commands_ahead_give_the_same_at_once(fmus: BuiltFmus, case: Case) -> None:
    run, late, arrived = case
    command = run.x_d.tolist() + [float(run.x_d[-1])] * NP
    measured = [float(run.x_d[0])] * NP + arrived
    samples = [Sample(x_d, x, k, None, True) for k, (x_d, x) in enumerate(zip(command, measured, strict=True))]
    kept, _ = live(fmus("HybridPredictor"), [*samples], measurement_delay=late)
    assert kept.begun == (1e-3, 0)
    assert equal([row._replace(k=row.k - NP) for row in kept.rows], run, late)


def test_a_replay_agrees_from_the_second_window_on(fmus: BuiltFmus, case: Case) -> None:
    run, late, arrived = case
    machine = load_machine("spring_mass_damper").changed("predictor", {"measurement_delay": late})
    found = backtest(warm_predictor(machine, None), run.x_d, arrived)
    samples = [Sample(*pair) for pair in zip(run.x_d.tolist(), arrived, strict=True)]
    kept, _ = live(fmus("HybridPredictor"), [*samples], measurement_delay=late)
    # A replay's last window has its predictions for what has not arrived yet
    difference = np.abs([row.x_h for row in kept.rows] - found.x_h[late:])
    assert difference[NP:].max() < 1e-11


def test_a_log_at_its_speed(fmus: BuiltFmus, case: Case, tmp_path: Path) -> None:
    run, late, arrived = case
    log = read_log(write_rows(tmp_path / "log.csv", run.x_d, np.array(arrived)))
    kept = Kept()
    done = run_live(
        RecordedSource(log, speed=8.0), FmuController(fmus("HybridPredictor"), {"measurement_delay": late}), [kept]
    )
    assert equal(kept.rows, run, late)
    assert np.allclose([row.t for row in kept.rows], np.arange(2500 - late) * 1e-3)
    assert done.status["n_repeated"] == done.status["n_late"] == 0
    with pytest.raises(ParameterError, match=r"speed must be 0 … 1e6, 0 for as fast as possible, got -1"):
        RecordedSource(log, -1.0)


def test_the_pace_of_a_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = read_log(write_rows(tmp_path / "log.csv", commanded()[:300], commanded()[:300]))
    now = [50.0]
    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    monkeypatch.setattr("time.sleep", lambda time: now.__setitem__(0, now[0] + time))
    at = [now[0] - 50.0 for sample in RecordedSource(log, speed=2.0).samples() if sample is not None]
    assert np.all(np.array(at) >= np.arange(300) * 0.5e-3 - 1e-9)
    assert np.all(np.array(at) <= np.arange(300) * 0.5e-3 + 1.5e-3)
    slow = list(RecordedSource(log, speed=1e-2).samples())
    assert [sample.k for sample in slow if sample is not None] == list(range(300))
    assert None in slow


def test_what_is_refused(fmus: BuiltFmus) -> None:
    fmu = fmus("HybridPredictor")
    kept = Kept()
    with pytest.raises(FmuError, match=r"sample 0 is refused: .*x_meas must be finite"):
        run_live(Listed([Sample(0.0, math.nan)] * 200), FmuController(fmu, {"averaging": False}), [kept])
    assert len(kept.ends) == 1
    assert "sample 0 is refused" in kept.ends[0]
    with pytest.raises(SignalError, match="sample 1: either all commands are ahead"):
        live(fmu, [Sample(0.0, 0.0), Sample(0.0, 0.0, ahead=True)])
    with pytest.raises(SignalError, match="samples 1 … 3 are missing"):
        live(fmu, [Sample(0.0, 0.0, 0), Sample(0.0, 0.0, 4), None])
    kept, _ = live(fmu, [Sample(0.0, 0.0, k) for k in (0, 1, 1, 3, 2)])
    assert kept.status["n_repeated"] == 1
    assert kept.status["n_late"] == 1
    kept, nothing = live(fmu, [])
    assert (nothing.status, kept.rows, kept.ends) == ({}, [], [""])


def test_quantiles_of_step_times() -> None:
    times = StepTimes()
    assert times.quantile(0.99) == 0.0
    drawn = np.random.default_rng(3).lognormal(-11.0, 1.0, 20_000)
    for time in drawn.tolist():
        times.add(time)
    for share in (0.5, 0.9, 0.99, 1.0):
        assert times.quantile(share) == pytest.approx(np.quantile(drawn, share), rel=0.03)
    assert times.longest == drawn.max()
    times.add(0.0)
    times.add(1e9)
    assert times.quantile(1.0) == 1e9
