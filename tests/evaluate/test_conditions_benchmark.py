"""Benchmark of conditions: sampling rates, cuts in motion, plants that change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import conditions
from benchmarks.trust import Case
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.machines.machine import load_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.trajectory import staircase


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "within"), [(250.0, 0.1), (2000.0, 0.05)])
def test_the_same_horizon_in_seconds_gives_the_same_error(rate: float, within: float) -> None:
    def path(T_s: float) -> Array:
        return staircase(T_s)[: round(2.3 / T_s)]

    machine = load_machine("spring_mass_damper")
    peer, found = (conditions._at_rate(machine, path, one) for one in (1000.0, rate))
    assert found == pytest.approx(peer, rel=within)


def test_runs_are_cut_where_they_move(monkeypatch: pytest.MonkeyPatch) -> None:
    x_d = np.concatenate((np.zeros(500), 1e-3 * np.sin(np.arange(500) / 40) ** 3))
    model = ModalModel([Mode(30.0, 0.3, (2 * np.pi * 30) ** 2)])
    case = Case("sine", model, PredictorSettings(), x_d, (x_d, x_d))
    monkeypatch.setattr(conditions, "cases", lambda *_: [case])
    monkeypatch.setattr(conditions, "random_cases", lambda _: [])
    cuts = [cut for _, cut in conditions.motions(None, None, 0)]
    assert len(cuts) == 1  # it rests at the other two
    assert abs(x_d[cuts[0] + 1] - x_d[cuts[0]]) == np.abs(np.diff(x_d[580:680])).max()


@pytest.mark.slow
def test_a_changed_plant_is_relearned_as_from_nothing() -> None:
    machine = load_machine("spring_mass_damper")
    changed = conditions._scaled(machine.new_plant(), {"k": 1.2})
    warm, cold = conditions._warm_and_cold(conditions._changed("", machine, changed, staircase()[:4000]))
    assert warm < 1.02 * cold
    assert 5e-6 < cold < 1e-5  # the noise and more


def test_a_delay_is_compared_at_one_horizon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive that is its model: what is left is the noise of the same samples."""
    model = ModalModel([Mode(30.0, 0.3, (2 * np.pi * 30) ** 2)])
    x_d = np.concatenate((np.zeros(100), 1e-3 * np.sin(np.arange(500) / 40)))
    x = model.discretise(1e-3).forced_response(model.discretise(1e-3).rest(), x_d)[0]
    noise = 1e-6 * np.random.default_rng(0).standard_normal(600)
    case = Case("sine", model, PredictorSettings(Np=50, p=5, q=1), x_d, (x + noise, x + noise))
    late = conditions._in_turn(case, replace(case.settings, measurement_delay=5))
    early = conditions._in_turn(case, case.settings, earlier=5)
    for errors, n in ((late, 595), (early, 600)):
        assert [len(error) for error in errors] == [n, n]
        np.testing.assert_allclose(errors[0], noise[:n], rtol=0, atol=1e-6)
    monkeypatch.setattr(conditions, "cases", lambda _: [case])
    monkeypatch.setattr(conditions, "random_cases", lambda _: [])
    ratios = [one / other for _, one, other in conditions.delays(None, 0, at_one_horizon=True)]
    assert ratios == pytest.approx([1.0, 1.0], rel=0.02)
