"""Reversal errors and friction against drives of known backlash and friction."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from two_mass.axis import Axis, Friction, LinearLoop
from two_mass.plant import TwoMassDrive

from hybridsep import HybridPredictor, Limits, ModalModel, Mode, PredictorSettings, read_log
from hybridsep.base.signals import Array
from hybridsep.evaluate.reversals import ReversalCurve, friction_table, reversal_curve
from hybridsep.fitting.advice import Judged
from hybridsep.fitting.replay import Recording, replay
from hybridsep.fitting.report import begun_report
from hybridsep.logs.formats import EXAMPLE
from hybridsep.plants.trajectory import rest_to_rest

T_S = 1e-3
STIFFNESS, K_V, K_P, FRICTION = 25e3, 30.0, 150.0, 0.5
LOOP = LinearLoop(
    load=0.4,
    stiffness=STIFFNESS,
    damping=10.0,
    viscous=0.2,
    k_v=K_V,
    k_p=K_P,
    t_i=0.0,
    feedforward=0.0,
    tau=1e-3,
    at_load=True,
    closed_at_load=False,
)
RUBBING = Friction(coulomb=FRICTION, presliding=5e-6, micro_damping=5.0)
OF_LOOP = 2.0 * FRICTION / (K_P * K_V)
"""What friction holds the motor back by, both ways, m: the loop has no integral action."""


def to_and_fro(velocities: tuple[float, ...]) -> Array:
    """Return a command to and fro over 20 mm at these velocities, m/s, (n,), m."""
    way = [rest_to_rest([0.0, 0.02, 0.0], Limits(v, 1.0, 50.0), T_S, dwell=0.05) for v in velocities]
    return np.concatenate(way)


X_D = to_and_fro((0.02, 0.05, 0.1, 0.03))


@cache
def rubbing() -> tuple[Array, Array]:
    """Return the residual of the drive with friction of its motor."""
    return residual(X_D, motor=RUBBING)


def residual(x_d: Array, **nonlinear: float | Friction) -> tuple[Array, Array]:
    """Return the position of the drive without its nonlinearities, and what they add, (1, n), m."""
    axis = Axis(LOOP, LOOP, len(x_d), T_S, **nonlinear)  # type: ignore[arg-type]
    x_pb, x = (TwoMassDrive(one).run(x_d) for one in (axis.linear(), axis))
    return x_pb, (x - x_pb)[None]


def curve(x_pb: Array, residuals: Array) -> ReversalCurve:
    """Return the curve, which there must be."""
    found = reversal_curve([(x_pb, residuals)])
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("nonlinear", "error"),
    [
        ({"motor": RUBBING}, OF_LOOP),
        ({"bearing": RUBBING, "play": 50e-6}, OF_LOOP + 2.0 * FRICTION / STIFFNESS + 50e-6),
    ],
)
def test_reversal_error_of_friction_and_backlash(nonlinear: dict[str, float | Friction], error: float) -> None:
    assert curve(*residual(X_D, **nonlinear)).errors[0] == pytest.approx(error, rel=0.01)


def test_a_lag_and_a_wrong_stiffness_are_no_reversal_error() -> None:
    x_pb, e = rubbing()
    wrong = e - 3.0 * np.gradient(x_pb) + 0.01 * x_pb
    assert curve(x_pb, wrong).errors == pytest.approx(curve(x_pb, e).errors, rel=0.01)


def test_distance_of_friction_before_sliding() -> None:
    way = np.cumsum(np.abs(np.diff(X_D, prepend=0.0)) / 2e-4)
    e, last = np.zeros(len(X_D)), 0.0
    for i, (step, sign) in enumerate(zip(np.diff(way, prepend=0.0), np.sign(np.diff(X_D, prepend=0.0)), strict=True)):
        last = e[i] = -1e-5 * sign + (last + 1e-5 * sign) * np.exp(-step)  # Dahl's friction, 0.2 mm
    noise = 1e-7 * np.random.default_rng(0).normal(size=len(X_D))
    assert curve(X_D, (e + noise)[None]).settling == pytest.approx(2e-4, rel=0.1)


def test_what_is_not_in_a_log_is_not_found() -> None:
    x_pb, e = rubbing()
    first = len(X_D) // 4
    assert reversal_curve([(x_pb[:first], e[:, :first])]) is None  # too few reversals
    noise = 1e-6 * np.random.default_rng(0).normal(size=e.shape)
    assert reversal_curve([(x_pb, noise)]) is None  # no friction
    assert reversal_curve([(x_pb, np.full(e.shape, np.nan))]) is None  # nothing measured
    once = to_and_fro((0.05,) * 4)
    assert reversal_curve([residual(once, motor=RUBBING)]) is None  # friction or a lag


def test_friction_at_steady_velocities() -> None:
    x_pb, residual = rubbing()
    residual[:, 2000] += 0.02  # an outlier
    v, e = friction_table([(x_pb, residual)], 0.0, 50)
    assert np.abs(v).max() / T_S == pytest.approx(0.1, rel=0.05)
    assert e[0] == pytest.approx(-0.5 * OF_LOOP * np.sign(v), rel=0.02)


def test_gaps_and_missing_measurements_are_left_out() -> None:
    x_pb, e = rubbing()
    half = len(x_pb) // 2
    e = np.where(np.arange(len(x_pb)) % 7, e, np.nan)
    found = reversal_curve([(x_pb[:half], e[:, :half]), (x_pb[half:], e[:, half:])])
    assert found is not None
    assert found.errors[0] == pytest.approx(OF_LOOP, rel=0.05)


def test_the_report_of_the_example_axis_shows_its_friction(tmp_path: Path) -> None:
    log = read_log(EXAMPLE)
    slow, fast = 2 * np.pi * 28.0, 2 * np.pi * 74.0
    model = ModalModel([Mode(28.0, 0.62, 0.94 * slow**2, 0.25 * slow), Mode(74.0, 0.06, 0.06 * fast**2, 0.0)])
    found = replay(
        HybridPredictor(model, PredictorSettings(Np=100, p=10, T_s=T_S)), [Recording(log.x_d, log.x_meas, 0)]
    )
    begun_report("axis", [log], Judged(found, T_S, log.shown, "the log"), "Errors", "").write(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    told = re.search(r"Reversal error (\S+) ± .* µm, .* The hybrid predicts (\S+) µm", page)
    assert told is not None
    assert [float(one) for one in told.groups()] == pytest.approx([36.0, 36.0], rel=0.05)
    assert "velocity [mm/s], error [µm]" in page
