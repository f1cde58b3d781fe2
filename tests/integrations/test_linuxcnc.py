"""The HAL component in a running LinuxCNC, on simulated drives; ``hybridsep hal`` without it.

The tests in a running LinuxCNC run at night: they need its package with the headers, root to install the component, and
an ordinary user that LinuxCNC runs as.
"""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import contour
import numpy as np
import pytest
import sampled_columns
from command_line import Run
from places import ROOT

from hybridsep import load_machine
from hybridsep.base.metrics import rms
from hybridsep.predict.predictor import HybridPredictor

SIMULATION = ROOT / "integrations" / "linuxcnc" / "simulation"
AXES = tuple(str(SIMULATION / f"{axis}.toml") for axis in sampled_columns.AXES)
USER = "nobody"


class TestWithoutLinuxCnc:
    def test_it_writes_the_component_and_a_folder_for_each_axis(self, hybridsep: Run, tmp_path: Path) -> None:
        status, out, _ = hybridsep("hal", *AXES, "--out", str(tmp_path))
        assert status == 0
        assert "halcompile --install" in out
        assert f"loadrt hsep axes={tmp_path}/x,{tmp_path}/y" in out.replace("\n", "")
        assert (tmp_path / "hsep.c").is_file()
        assert (tmp_path / "hsep_sources" / "all.c").is_file()
        assert not list(tmp_path.rglob("*fmi2*"))
        assert [path.name for path in (tmp_path / "x").iterdir()] == ["variables.bin"]

    def test_an_axis_starts_with_what_was_learned(self, hybridsep: Run, tmp_path: Path) -> None:
        machine = load_machine(AXES[0])
        predictor = HybridPredictor(machine.model, machine.new_compensator().predictor.settings, start=0.0)
        command = 1e-3 * np.sin(0.1 * np.arange(20))
        predictor.predict(command)
        predictor.update(0.99 * command)
        predictor.save(tmp_path / "x.state")
        given = ("--out", str(tmp_path), "--weights", str(tmp_path / "x.state"))
        assert hybridsep("hal", AXES[0], *given)[0] == 0
        assert (tmp_path / "x" / "weights.bin").read_bytes().startswith(b"HSEPWG")
        status, out, _ = hybridsep("hal", AXES[0], "--out", str(tmp_path))
        assert (status, "weights.bin removed: without --weights the axis starts cold" in out) == (0, True)
        assert not (tmp_path / "x" / "weights.bin").exists()
        status, _, err = hybridsep("hal", *AXES, *given)
        assert (status, "--weights belong to one axis" in err) == (2, True)

    def test_a_compensator_needs_limits_a_predictor_does_not(self, hybridsep: Run, tmp_path: Path) -> None:
        status, _, err = hybridsep("hal", "emps", "--out", str(tmp_path))
        assert status == 2
        assert "[drive_limits] in the machine file of emps; --predictor writes" in " ".join(err.split())
        assert hybridsep("hal", "emps", "--predictor", "--out", str(tmp_path))[0] == 0
        assert (tmp_path / "hsep_predictor.c").is_file()

    def test_two_axes_of_one_name_are_refused(self, hybridsep: Run, tmp_path: Path) -> None:
        status, _, err = hybridsep("hal", AXES[0], AXES[0], "--out", str(tmp_path))
        assert (status, "each axis must have a name of its own" in err) == (2, True)


def can_run() -> str:
    """Return why LinuxCNC cannot run here; empty if it can."""
    if not all(map(shutil.which, ("linuxcnc", "halcompile", "runuser"))):
        return "LinuxCNC and its headers are not installed (Debian: linuxcnc-uspace, linuxcnc-uspace-dev)"
    if os.geteuid() != 0:
        return "halcompile --install needs root"
    try:
        pwd.getpwnam(USER)
    except KeyError:
        return f"there is no user {USER}"
    return ""


IN_LINUXCNC = pytest.mark.skipif("HYBRIDSEP_LINUXCNC" not in os.environ and bool(can_run()), reason=can_run())
"""With HYBRIDSEP_LINUXCNC set, what is not there fails."""


@pytest.fixture(scope="module")
def installed() -> Iterator[Path]:
    """A folder that the ordinary user may read, with the component installed."""
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o755)
        contour.install(Path(place))
        yield Path(place)


@pytest.mark.nightly
@IN_LINUXCNC
def test_the_contour_of_a_circle_is_compensated(installed: Path) -> None:
    samples = contour.run_cases("circle", installed, USER)
    errors = {case: rms(one.contour_errors()) for case, one in samples.items()}
    assert errors["hybrid warm"] <= 0.3 * errors["off"]
    assert errors["hybrid warm"] < errors["physics"] < errors["off"]
    assert all(one.n_lost == 0 for one in samples.values())
    assert set(np.unique(samples["off"].state)) <= {0, 1}
    assert 3 in samples["hybrid cold"].state


@pytest.mark.nightly
@IN_LINUXCNC
def test_both_components_load_side_by_side(installed: Path) -> None:
    contour.hybridsep("hal", "emps", "--predictor", "--out", str(installed / "hal"))
    source = str(installed / "hal" / "hsep_predictor.c")
    subprocess.run(["halcompile", "--install", source], check=True, capture_output=True)
    loaded = installed / "both.hal"
    loaded.write_text(
        f"loadrt hsep axes={installed}/hal/x\nloadrt hsep_predictor axes={installed}/hal/emps\nshow pin\n"
    )
    home = installed / "home"
    home.mkdir()
    shutil.chown(home, USER)
    command = ["runuser", "-u", USER, "--", "env", f"HOME={home}", "halrun", "-f", str(loaded)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert {"hsep.x.out", "hsep_predictor.emps.predicted"} <= set(done.stdout.split()), done.stderr


@pytest.mark.nightly
@IN_LINUXCNC
def test_what_an_operator_does_in_motion_keeps_the_joints_limits(installed: Path) -> None:
    contour.run("stops.py", installed / "stops.txt", installed, {}, USER)
    samples = contour.Samples.read(installed / "stops.txt")
    assert samples.n_lost == 0
    limits = load_machine(AXES[0]).drive_limits
    assert limits is not None
    for axis in range(2):
        active = samples.state[:, axis] > 0
        steps = np.diff(samples.out[:, axis])
        second = np.diff(steps)
        ongoing = active[1:] & active[:-1]
        assert np.abs(steps[ongoing]).max() <= limits.velocity + 1e-6
        both = ongoing[1:] & ongoing[:-1]
        assert np.abs(second[both]).max() <= 1e3 * limits.acceleration * 1e-6 + 2e-6  # its samples have six decimals
        change = samples.out[:, axis] - samples.delayed[:, axis]
        assert np.abs(change[active]).max() <= 1e3 * limits.change_max + 1e-6
        assert {0, 1, 3} <= set(np.unique(samples.state[:, axis]))


@pytest.mark.slow
def test_a_sampled_log_is_read_as_it_is(hybridsep: Run, tmp_path: Path) -> None:
    n = 4000
    command = 10.0 * np.sin(2e-3 * np.arange(n))
    table = np.column_stack([np.arange(n), *[command] * (len(sampled_columns.COLUMNS) - 1)])
    np.savetxt(tmp_path / "samples.txt", table, header=" ".join(sampled_columns.COLUMNS), comments="", fmt="%.6f")
    reading = ("--x_d", "x_out", "--x", "x_fb", "--unit", "mm", "--T_s", "0.001")
    status, _, err = hybridsep("backtest", str(tmp_path / "samples.txt"), "--machine", AXES[0], *reading, "--as-is")
    assert status == 0, err
