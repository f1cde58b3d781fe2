"""The compensator in closed loop: the figures it reaches, and what is refused and saved."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from compensator_cases import DRIVE_LIMITS, MODEL, RECOMMENDED, beyond, closed, compensator, move, turned

from hybridsep.base.errors import ParameterError, SignalError
from hybridsep.base.settings import CompensatorSettings, PredictorSettings
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.model.physics import ModalModel
from hybridsep.online.look_ahead import SepState
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Plant
from hybridsep.plants.trajectory import PAPER_LIMITS
from hybridsep.predict.predictor import HybridPredictor


@pytest.mark.slow
def test_figures_with_the_papers_settings() -> None:
    assert 1e6 * closed(compensator("off")).tracking_rms == pytest.approx(88.5, abs=0.2)
    assert 1e6 * closed(compensator("physics")).tracking_rms == pytest.approx(20.2, abs=0.2)
    sep = compensator()
    assert 1e6 * closed(sep).tracking_rms == pytest.approx(6.34, abs=0.3)
    warm = closed(sep, 1000, t_init=0.0)
    assert 1e6 * warm.tracking_rms == pytest.approx(4.97, abs=0.3)
    assert (warm.state == SepState.HYBRID).all()


@pytest.mark.slow
def test_figures_with_the_recommended_settings() -> None:
    sep = compensator(**asdict(RECOMMENDED))
    cold, warm = closed(sep), closed(sep, 1000, t_init=0.0)
    assert 1e6 * cold.tracking_rms == pytest.approx(4.75, abs=0.3)
    assert 1e6 * warm.tracking_rms == pytest.approx(1.95, abs=0.2)
    for loop in (cold, warm):
        assert beyond(loop.x_dm, DRIVE_LIMITS) <= 1.0
        assert turned(loop.x_dm, loop.x_d) == 0


@pytest.mark.slow
@pytest.mark.parametrize("trouble", ["changed", "noise", "limits"])
def test_trouble_never_makes_it_worse_than_physics(trouble: str) -> None:
    def change(k: int, drive: Plant) -> None:
        if k == 3050 and isinstance(drive, FeedDrive):
            drive.k, drive.c_nl, drive.k_nl = 1.1 * drive.k, 2 * drive.c_nl, 2 * drive.k_nl

    more: dict[str, Any] = {"disturb": change} if trouble == "changed" else {"n": 2000}
    more |= {"noise": 5e-5} if trouble == "noise" else {}
    settings_: dict[str, Any] = {} if trouble == "noise" else asdict(RECOMMENDED)
    limits = PAPER_LIMITS if trouble == "limits" else DRIVE_LIMITS
    physics = closed(compensator("physics", limits, **settings_), **more)
    hybrid = closed(compensator(limits=limits, **settings_), **more)
    assert hybrid.tracking_rms <= 1.05 * physics.tracking_rms
    assert np.isfinite(hybrid.x_dm).all()
    assert beyond(hybrid.x_dm, limits) <= 1.0 + 1e-9
    assert np.max(np.abs(hybrid.x_dm - hybrid.x_d)) <= 1e-3


@pytest.mark.slow
def test_a_dead_time_that_is_too_long_is_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the command acts 12 samples before the physics model says so: 2.6 µm instead of 227 with its plans."""
    monkeypatch.setattr("compensator_cases.MODEL", ModalModel(MODEL.modes, dead_time=12))
    sep = compensator(averaging=True, Np=20, p=20)
    closed(sep, n=1500)
    assert closed(sep, 1, n=1100).tracking_rms < 5e-6


def test_only_what_is_tunable_changes_in_a_run() -> None:
    """How it fades, on every implementation: tests/suite/test_tunable.py."""
    sep = compensator()
    before = sep.to_bytes()
    said = "preview, spacing cannot change in a run, change_max, following_error_max, compensate can"
    with pytest.raises(ParameterError, match=said):
        sep.change(preview=300, spacing=1, compensate="off")
    with pytest.raises(ParameterError, match="compensate must be one of off, physics, hybrid, got 'none'"):
        sep.change(compensate="none")
    assert sep.to_bytes() == before
    sep.change(compensate="physics", change_max=None)
    assert sep.compensate is SepState.PHYSICS
    assert SepCompensator.from_bytes(sep.to_bytes()).settings == sep.settings


def test_windows_are_monitored_as_samples_are() -> None:
    """Sample by sample, on every implementation: tests/suite/test_tunable.py."""
    predictor = HybridPredictor(MODEL, PredictorSettings(Np=50, p=10, measurement_delay=2))
    sep = SepCompensator(predictor, CompensatorSettings(preview=200, limits=DRIVE_LIMITS, following_error_max=1e-6))
    x_d, late = move(400), np.concatenate((np.zeros(2), move(400)))
    for k in (0, 50, 100):
        assert sep.plan(x_d[k : k + 200]).state != SepState.OFF
        assert not sep.monitor.is_tripped
        sep.update(late[k : k + 50] + 2e-6 * np.isin(np.arange(k, k + 50), (98, 99, 100)))
    assert sep.monitor.is_tripped
    assert sep.plan(x_d[150:350]).state == SepState.OFF
    sep.monitor.reset()
    assert sep.plan(x_d[150:350]).state != SepState.OFF
    assert not SepCompensator.from_bytes(sep.to_bytes()).monitor.is_tripped


def test_bad_samples_change_nothing() -> None:
    sep = compensator()
    with pytest.raises(SignalError, match="update must follow plan"):
        sep.update(np.zeros(100))
    with pytest.raises(SignalError, match="x_d must have 200 samples, got 100"):
        sep.plan(np.zeros(100))
    sep.plan(np.zeros(200))
    before = sep.to_bytes()
    for bad in (np.zeros(99), np.full(100, np.inf), np.full(100, np.nan)):
        with pytest.raises(SignalError, match="x must"):
            sep.update(bad)
    assert sep.to_bytes() == before
