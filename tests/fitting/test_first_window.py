"""First window of a log that begins in motion: it neither ranks candidates nor hides behind the others' figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, predictor, write_rows
from staircase_data import commanded, measured

from hybridsep import HybridPredictor, load_machine
from hybridsep.base.metrics import rms
from hybridsep.evaluate.backtest import backtest
from hybridsep.fitting.choice import with_window
from hybridsep.fitting.tuning import losses, unsettled

NP = 50
FIRST = 40
"""Sample in the first move."""


def test_losses_are_those_of_a_replay_without_its_first_window() -> None:
    machine = load_machine("spring_mass_damper")
    settings = replace(with_window(machine.predictor_settings, NP), averaging=False, measurement_delay=0)
    x_d, x = commanded()[FIRST:2000], measured(0)[FIRST:2000]
    assert unsettled(commanded()[:2000], measured(0)[:2000], NP).n_settling == 0
    assert unsettled(x_d[:NP], x[:NP], NP).n_settling == 0  # nothing would be left
    found = backtest(HybridPredictor(machine.model, settings), x_d, x)
    expected = [rms((x - one)[NP:]) for one in (found.x_pb, found.x_hold, found.x_h)]
    assert rms(x - found.x_pb) > 1.2 * expected[0]
    found_losses = losses(machine.model, ([unsettled(x_d, x, NP)], settings))
    np.testing.assert_allclose(found_losses, expected, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, FIRST])
def test_tune_leaves_it_out(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: int) -> None:
    log = write_rows(tmp_path / "axis.csv", commanded()[first:2000], measured(0)[first:2000])
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    few = (*predictor(Np=NP), "--try", "p=10", "--try", "q=1", "--try", "forgetting=0")
    status, _, err = hybridsep("tune", log, "--machine", "spring_mass_damper", *few)
    assert status == 0, err
    assert ("axis.csv: begins in motion, and is ranked without its first window" in err) == (first > 0)
