"""``hybridsep init``: machine files by options and by questions."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import Run

from hybridsep import load_machine


def test_a_lag(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "x_axis.toml"
    arguments = ("--tau", "0.006", "--T_s", "0.002", "--dead-time", "3", "--Np", "20")
    status, out, _ = hybridsep("init", path, *arguments)
    assert status == 0
    assert "written: lag, tau = 0.006" in out
    machine = load_machine(path)
    assert (machine.name, machine.T_s, machine.predictor_settings.Np) == ("x_axis", 0.002, 20)
    omega = np.array([1.0, 100.0])
    expected = np.exp(-1j * omega * 0.006) / (1 + 0.006j * omega)
    np.testing.assert_allclose(machine.model.frequency_response(omega, 0.002), expected, rtol=1e-12)
    text = path.read_text(encoding="utf-8")
    assert "# Hz, natural frequency of the mode" in text
    assert "# samples in a look-ahead window" in text


@pytest.mark.parametrize(
    ("arguments", "alpha"),
    [
        (("--model", "second-order", "--f_n", "20", "--zeta", "0.5"), (40 * np.pi) ** 2),
        (("--model", "mass", "--m", "2", "--c", "30", "--k", "20000"), 10_000.0),
        (("--from-tf", "[14412.2]", "1, 14.66, 14412.2", "--hold", "foh"), 14412.2),
    ],
)
def test_other_models(hybridsep: Run, tmp_path: Path, arguments: tuple[str, ...], alpha: float) -> None:
    path = tmp_path / "axis.toml"
    status, _, err = hybridsep("init", path, *arguments)
    assert (status, err) == (0, "")
    assert load_machine(path).model.modes[0].alpha == pytest.approx(alpha, rel=1e-9)
    assert load_machine(path).model.dc_gain == pytest.approx(1.0)


def test_questions(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = io.StringIO("bench\n0.001\nsecond-order\n25\n0.7\n2\nfoh\n50\n")
    monkeypatch.setattr(answers, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stdin", answers)
    path = tmp_path / "axis.toml"
    status, out, _ = hybridsep("init", path)
    assert status == 0
    assert "natural frequency of the position loop [Hz]" in out
    machine = load_machine(path)
    assert (machine.name, machine.physics.dead_time, machine.physics.input_hold) == ("bench", 2, "foh")
    assert machine.model.modes[0].f_n == 25.0
    assert machine.predictor_settings.Np == 50


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--tau is missing: time constant"),
        (("--model", "guess"), "--model must be one of lag, second-order"),
        (("--tau", "-1"), "tau must be above 0 s"),
        (("--tau", "0.01", "--name", "my axis"), "name"),
        (("--from-tf", "a", "1 2"), "a coefficient must be a number, got 'a'"),
        (("--from-tf", "", "1 2"), "a polynomial needs coefficients"),
        (("--from-tf", "1", "1 -2"), "must be stable"),
        (("--tau", "0.01", "--hold", "spline"), "input_hold"),
    ],
)
def test_what_is_refused(hybridsep: Run, tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    path = tmp_path / "axis.toml"
    status, _, err = hybridsep("init", path, *arguments)
    assert status == 2
    assert message in " ".join(err.split())
    assert "fault of hybridsep" not in err
    assert not path.exists()
