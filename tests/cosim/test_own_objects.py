"""A compensator and a plant of the user's own in a run, and results at a prompt: what a newcomer tries first."""

import numpy as np
import pytest

from hybridsep import Compensator, LookAhead, SepCompensator, backtest, cosimulate, load_machine, staircase
from hybridsep.base.errors import ParameterError, SignalError

T_S = 1e-3


class Lead:
    """Compensator of the user's own: the command plus what it will change by in ``lead`` samples, four samples late."""

    T_s, delay = T_S, 4

    def __init__(self, lead: float) -> None:
        self.lead = lead

    def restart(self, start: float) -> None:
        self.commands = [start] * self.delay

    def step(self, x_d_ahead: float, x_meas: float) -> float:
        self.commands = [*self.commands[1:], x_d_ahead]
        return self.commands[0] + self.lead * (self.commands[1] - self.commands[0])


class Lag:
    """Plant of the user's own, with what a run needs and no more."""

    x = 0.0

    def reset(self, start: float = 0.0) -> None:
        self.x = start

    def step(self, x_d: float, h: float) -> None:
        self.x += (1 - np.exp(-h / 3e-3)) * (x_d - self.x)


def test_a_compensator_and_a_plant_of_ones_own() -> None:
    x_d = staircase()[:1200] + 0.1
    without, compensated = (cosimulate(Lead(lead), Lag(), x_d) for lead in (0.0, 3.0))
    np.testing.assert_array_equal(without.x_d, x_d)
    np.testing.assert_array_equal(without.x_dm, x_d)
    assert compensated.tracking_rms < 0.5 * without.tracking_rms
    assert np.isnan(compensated.x_pb).all()
    assert repr(compensated).startswith("Run(n_samples = 1200, tracking_rms_um = ")
    wrong = Lead(0.0)
    wrong.delay = 0
    with pytest.raises(ParameterError, match="the compensator's delay must be 1"):
        cosimulate(wrong, Lag(), x_d)
    with pytest.raises(SignalError, match="the compensator's command must be finite, got nan at sample 0"):
        cosimulate(Lead(np.nan), Lag(), x_d)
    with pytest.raises(ParameterError, match="a compensator of your own has none"):
        cosimulate(Lead(0.0), Lag(), x_d, t_init=0.0)


def test_the_compensators_own_step_is_its_look_ahead() -> None:
    machine, x_d = load_machine("spring_mass_damper"), staircase()[:500] + 0.1
    loops = [machine.new_compensator(), machine.new_compensator()]
    loop: SepCompensator = loops[0]
    ahead, plant = LookAhead(loops[1], float(x_d[0])), machine.new_plant()
    plant.reset(float(x_d[0]))
    stepped: Compensator = loop  # it has the interface of one's own
    assert (stepped.delay, stepped.T_s) == (loop.preview, T_S)
    for r in x_d.tolist():
        command, x = ahead.x_dm, plant.x
        plant.step(command, T_S)
        ahead.sample(r, x)
        assert loop.step(r, x) == ahead.x_dm
    assert ahead.x_dm != ahead.x_d
    loop.restart(0.2)
    assert loop.step(0.2, 0.2) == pytest.approx(0.2, abs=1e-12)


def test_results_print_in_a_line_and_plot() -> None:
    machine, x_d = load_machine("spring_mass_damper"), staircase()[:700]
    result = backtest(machine.new_predictor(), x_d, x_d)
    run = cosimulate(machine.new_predictor(), machine.new_plant(), x_d)
    for one, label in ((result, "hybrid"), (run, "hybrid"), (cosimulate(Lead(1.0), Lag(), x_d), "tracking error")):
        assert "\n" not in repr(one)
        assert len(repr(one)) < 200
        assert one._repr_html_().startswith("<table><caption>")
        assert label in [line.get_label() for line in one.plot().axes[0].lines]
    assert "rms_h_um = " in repr(run)
    assert f"rms_pb_um = {result.summary()['rms_pb_um']:.4g}" in repr(result)
