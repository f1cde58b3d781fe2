"""``hybridsep init``: a machine file to edit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from command_line import Run

from hybridsep import load_machine


def test_a_lag(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "x_axis.toml"
    status, out, _ = hybridsep("init", path, "--tau", "0.004")
    assert status == 0
    assert "written: lag, tau = 0.004" in out
    machine = load_machine(path)
    assert (machine.name, machine.T_s, machine.predictor_settings.Np) == ("x_axis", 1e-3, 100)
    omega = np.array([1.0, 100.0])
    np.testing.assert_allclose(machine.model.frequency_response(omega, 1e-3), 1 / (1 + 0.004j * omega), rtol=1e-12)
    text = path.read_text(encoding="utf-8")
    assert "# Hz, natural frequency of the mode" in text
    assert "# samples in a look-ahead window" in text


def test_what_is_commented_out_is_a_machine_file_too(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "axis.toml"
    assert hybridsep("init", path)[0] == 0
    head, modes, rest = re.split(r"(?=\n\[\[physics\.mode\]\]|\n\[predictor\])", path.read_text(encoding="utf-8"))
    assert "f_n" in modes
    path.write_text(head + re.sub(r"^# (?=\[|\w+ = )", "", rest, flags=re.MULTILINE), encoding="utf-8")
    machine = load_machine(path)
    assert machine.new_compensator().settings.limits is not None
    assert machine.physics.spring_mass_damper is not None
    assert machine.log.columns == {"t": "time", "x_d": "command", "x": "position"}


@pytest.mark.parametrize(
    ("arguments", "alpha"),
    [
        (("--f_n", "20", "--zeta", "0.5"), (40 * np.pi) ** 2),
        (("--from-tf", "[14412.2]", "1, 14.66, 14412.2"), 14412.2),
    ],
)
def test_other_models(hybridsep: Run, tmp_path: Path, arguments: tuple[str, ...], alpha: float) -> None:
    path = tmp_path / "axis.toml"
    status, _, err = hybridsep("init", path, *arguments)
    assert (status, err) == (0, "")
    assert load_machine(path).model.modes[0].alpha == pytest.approx(alpha, rel=1e-9)
    assert load_machine(path).model.dc_gain == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--f_n", "20"), "--f_n and --zeta must come together"),
        (("--tau", "0.01", "--f_n", "20", "--zeta", "1"), "exclude each other"),
        (("--tau", "-1"), "tau must be above 0 s"),
        (("--from-tf", "a", "1 2"), "coefficients must be numbers, got 'a'"),
        (("--from-tf", "", "1 2"), "a polynomial needs coefficients"),
        (("--from-tf", "1", "1 -2"), "must be stable"),
    ],
)
def test_what_is_refused(hybridsep: Run, tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    path = tmp_path / "axis.toml"
    status, _, err = hybridsep("init", path, *arguments)
    assert status == 2
    assert message in " ".join(err.split())
    assert "fault of hybridsep" not in err
    assert not path.exists()
