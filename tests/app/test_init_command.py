"""``hybridsep init``: a machine file to edit."""

import re
from pathlib import Path

import numpy as np
from command_line import Run

from hybridsep import load_machine


def test_a_lag(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "x_axis.toml"
    status, out, _ = hybridsep("init", path)
    assert status == 0
    assert "written: a lag, tau = 0.006" in out
    machine = load_machine(path)
    assert (machine.name, machine.T_s, machine.predictor_settings.Np) == ("x_axis", 1e-3, 100)
    omega = np.array([1.0, 100.0])
    np.testing.assert_allclose(machine.model.frequency_response(omega, 1e-3), 1 / (1 + 0.006j * omega), rtol=1e-12)
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
