"""``hybridsep fit`` with what is known of an axis: a period of its error, a late encoder; the hint at a period."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from identification_cases import T_S, measured

from hybridsep import PAPER_LIMITS, HybridPredictor, ModalModel, Mode, load_machine, rest_to_rest
from hybridsep.base.signals import Array
from hybridsep.cosim.fmu import read_description
from hybridsep.identify.periodic import residual_period

AXIS = ModalModel([Mode(35.0, 0.4, (70 * np.pi) ** 2)])
PITCH, LATE = 0.01, 5


def long_moves(seed: int = 0, n: int = 5) -> Array:
    """Return moves within 60 mm, (n·900,), m."""
    targets = np.concatenate(([0.0], np.random.default_rng(seed).uniform(-0.03, 0.03, n)))
    starts = [0.05 + 0.9 * i for i in range(n)]
    return rest_to_rest(targets, PAPER_LIMITS, T_S, start_times=starts, duration=0.9 * n + 0.1)[: 900 * n]


def screw(x_d: Array, amplitude: float, seed: int = 0, friction: float = 3e-6) -> Array:
    """Return the measured position of an axis whose screw errs by an amplitude over its pitch, m."""
    rubbed = x_d - friction * np.tanh(np.gradient(x_d, T_S) / 2e-3)
    return measured(AXIS, rubbed + amplitude * np.sin(2 * np.pi * x_d / PITCH + 1.0), "zoh", 5e-7, seed)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("friction", [0.0, 20e-6])
def test_a_period_is_found_where_there_is_one_only(seed: int, friction: float) -> None:
    x_d = long_moves(seed)
    for amplitude, period in ((0.0, 0.0), (2e-6 + friction, PITCH)):
        pieces = [(x_d, screw(x_d, amplitude, seed, friction))]
        assert residual_period(pieces, AXIS, T_S, "zoh") == period


def test_a_vibration_in_time_is_no_period() -> None:
    x_d = long_moves(1)
    shaken = screw(x_d, 0.0) + 5e-6 * np.sin(2 * np.pi * 13.0 * T_S * np.arange(len(x_d)))
    assert residual_period([(x_d, shaken)], AXIS, T_S, "zoh") == 0.0
    assert residual_period([(np.zeros(50), np.zeros(50))], AXIS, T_S, "zoh") == 0.0


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_period_is_hinted_at_and_taken(hybridsep: Run, tmp_path: Path) -> None:
    x_d = long_moves()
    log = write_rows(tmp_path / "axis.csv", x_d, screw(x_d, 8e-6))
    out = hybridsep.done("fit", log, "--out", tmp_path / "without", "--Np", 50)
    words = " ".join(out.split())
    assert "the residual repeats every 10 mm: with --period 0.01 the hybrid's error would go from " in words
    found = json.loads((tmp_path / "without" / "fit.json").read_text())
    [period] = [one for one in found["identification"]["findings"] if one.startswith("the residual repeats")]
    assert period.split(" m")[0] in (tmp_path / "without" / "report.html").read_text(encoding="utf-8")
    out = hybridsep.done("fit", log, "--out", tmp_path / "with", "--Np", 50, "--period", PITCH)
    assert "the residual repeats" not in out
    training = json.loads((tmp_path / "with" / "fit.json").read_text())
    assert training["judged"]["rms_h"] < 0.5 * found["judged"]["rms_h"]
    machine = load_machine(tmp_path / "with" / "machine.toml")
    assert machine.predictor_settings.period == PITCH
    assert HybridPredictor.load(tmp_path / "with" / "trained.state").settings.period == PITCH
    for fmu in (tmp_path / "with").glob("*.fmu"):
        assert start_of(fmu, "period") == PITCH


def start_of(fmu: Path, name: str) -> float:
    [variable] = [one for one in read_description(fmu).modelVariables if one.name == name]
    return float(variable.start)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_late_encoder_is_no_dead_time(hybridsep: Run, tmp_path: Path) -> None:
    x_d = long_moves(2, n=2)
    x = screw(x_d, 0.0)
    late = np.concatenate((np.full(LATE, x[0]), x[:-LATE]))
    logs = {0: write_rows(tmp_path / "axis.csv", x_d, x), LATE: write_rows(tmp_path / "late.csv", x_d, late)}
    results = {}
    for n_late, log in logs.items():
        out = tmp_path / f"fit{n_late}"
        said = hybridsep.done("fit", log, "--out", out, "--Np", 50, "--measurement_delay", n_late, "--json")
        results[n_late] = json.loads(said)
        machine = load_machine(out / "machine.toml")
        assert machine.predictor_settings.measurement_delay == n_late
        for fmu in out.glob("*.fmu"):
            assert start_of(fmu, "measurement_delay") == n_late
            assert start_of(fmu, "dead_time") == machine.model.dead_time
    models = [result["identification"] for result in results.values()]
    assert models[0]["structure"] == models[1]["structure"]
    assert models[0]["dead_time"] == models[1]["dead_time"]
    for one, other in zip(models[0]["modes"], models[1]["modes"], strict=True):
        assert one == pytest.approx(other, rel=0.01)
    # Judged with what arrives: the last residuals of a window are not known yet.
    assert results[LATE]["judged"]["rms_h"] < 2 * results[0]["judged"]["rms_h"]
