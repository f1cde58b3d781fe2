"""Checks of a stream's first seconds, and a warm start from what lies beside the machine file."""

from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from staircase_data import commanded, measured

from hybridsep import backtest, load_machine
from hybridsep.logs.checks import Finding
from hybridsep.machines.machine import machine_path
from hybridsep_live.first_seconds import FirstSeconds
from hybridsep_live.sample import Sample

WRONG = {"": (1.0, 1.0), "unit": (1e3, 1e3), "scale": (1.0, 1e3), "sign": (1.0, -1.0)}


def found(x_d: np.ndarray, x: np.ndarray, *, ahead: bool = False) -> list[Finding]:
    said: list[Finding] = []
    first = FirstSeconds("m", 1e-3, 100, stated=False, say=said.extend)
    for k, (command, position) in enumerate(zip(x_d.tolist(), x.tolist(), strict=True)):
        first.take(Sample(command, position, k, ahead=ahead))
    first.finish()
    return said


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("ahead", [False, True])
def test_wrong_columns_are_said(name: str, ahead: bool) -> None:
    of_command, of_position = WRONG[name]
    x_d, x = of_command * commanded()[:4000], of_position * measured(0)[:4000]
    if ahead:  # commands come a look-ahead of 100 samples before
        x_d, x = x_d[100:], x[:-100]
    said = [one.name for one in found(x_d, x, ahead=ahead)]
    assert said == ([name] if name else [])


def test_an_axis_that_rests_is_said_and_a_few_samples_are_not_judged() -> None:
    rest = np.full(20_000, commanded()[0])
    [finding] = found(rest, rest)
    assert finding.name == "no motion"
    assert found(commanded()[:400], -measured(0)[:400]) == []
    x_d, x = commanded()[:4000], measured(0)[:4000]
    assert [one.name for one in found(np.r_[rest, x_d], np.r_[rest, -x])] == ["sign"]


def test_the_command_says_them_and_starts_warm(tmp_path: Path, hybridsep: Run) -> None:
    machine = load_machine("spring_mass_damper")
    predictor = machine.new_predictor()
    backtest(predictor, commanded()[:1500], measured(0)[:1500])
    folder = tmp_path / "axis"
    folder.mkdir()
    (folder / "machine.toml").write_bytes(machine_path("spring_mass_damper").read_bytes())
    predictor.save(folder / "trained.state")
    log = write_rows(tmp_path / "log.csv", commanded()[:2500], -measured(0)[:2500])
    live = ("live", log, "-m", folder / "machine.toml", "--no-page", "--speed", "0")
    status, _, err = hybridsep(*live)
    assert status == 0
    assert f"note: starts warm, from {folder / 'trained.state'} (--cold starts without)" in err
    assert "the first seconds: error: sign: the measured position moves opposite to the command" in err
    status, _, err = hybridsep(*live, "--cold")
    assert (status, "starts" in err) == (0, False)
