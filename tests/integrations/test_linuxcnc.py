"""The HAL component in a running LinuxCNC, on simulated drives; ``hybridsep hal`` without it.

Those in a running LinuxCNC, at night, need its package with the headers, root, and an ordinary user that it runs as.
"""

import fcntl
import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import contour
import numpy as np
import pytest
import sampled_columns
from command_line import Run
from machine_files import changed_machine
from places import ROOT

from hybridsep import load_machine
from hybridsep.predict.predictor import HybridPredictor

SIMULATION = ROOT / "integrations" / "linuxcnc" / "simulation"
AXES = tuple(str(SIMULATION / f"{axis}.toml") for axis in sampled_columns.AXES)
USER = "nobody"


def test_a_component_and_a_folder_for_each_axis_are_written(hybridsep: Run, tmp_path: Path) -> None:
    status, out, err = hybridsep("hal", *AXES, "--out", tmp_path)
    assert status == 0, err
    assert "halcompile --install" in out
    assert f"loadrt hsep axes={tmp_path}/x,{tmp_path}/y" in out.replace("\n", "")
    assert "estimates" not in err
    assert (tmp_path / "hsep.c").is_file()
    assert (tmp_path / "hsep_sources" / "all.c").is_file()
    assert not list(tmp_path.rglob("*fmi2*"))
    assert [path.name for path in (tmp_path / "x").iterdir()] == ["variables.bin"]
    changes = ('name = "x"', f'name = "{"n" * 31}"'), ("[drive_limits]\n", "[drive_limits]\nestimated = true\n")
    longest = changed_machine(tmp_path / "axis.toml", AXES[0], *changes)
    status, _, err = hybridsep("hal", longest, "--out", tmp_path, "--force")
    assert (status, f"warning: [drive_limits] of {'n' * 31}: estimates" in err) == (0, True)
    hybridsep.done("hal", "emps", "--predictor", "--out", tmp_path)
    assert (tmp_path / "hsep_predictor.c").is_file()


def test_an_axis_starts_with_what_was_learned(hybridsep: Run, tmp_path: Path) -> None:
    machine = load_machine(AXES[0])
    predictor = HybridPredictor(machine.model, machine.new_compensator().predictor.settings, start=0.0)
    command = 1e-3 * np.sin(0.1 * np.arange(20))
    predictor.predict(command)
    predictor.update(0.99 * command)
    predictor.save(tmp_path / "x.state")
    given = ("--out", tmp_path, "--weights", tmp_path / "x.state")
    hybridsep.done("hal", AXES[0], *given)
    assert (tmp_path / "x" / "weights.bin").read_bytes().startswith(b"HSEPWG")
    out = hybridsep.done("hal", AXES[0], "--out", tmp_path, "--force")
    assert "weights.bin removed: without --weights the axis starts cold" in out
    assert not (tmp_path / "x" / "weights.bin").exists()


@pytest.mark.parametrize(("letters", "options"), [(32, []), (22, ["--predictor"])])
def test_a_name_too_long_for_hal_is_refused(hybridsep: Run, tmp_path: Path, letters: int, options: list[str]) -> None:
    """Other refusals: tests/app/test_cli_files.py."""
    given = changed_machine(tmp_path / "axis.toml", AXES[0], ('name = "x"', f'name = "{"n" * letters}"'))
    assert f"at most {letters - 1} letters" in hybridsep.refused("hal", given, "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


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


@contextmanager
def alone() -> Iterator[None]:
    """Wait for the tests of other processes: a machine runs one LinuxCNC."""
    with (Path(tempfile.gettempdir()) / "hybridsep_linuxcnc.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="module")
def place() -> Iterator[Path]:
    """A folder that the ordinary user may read, with the component installed."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        with alone():
            contour.install(Path(folder))
        yield Path(folder)


@pytest.fixture
def installed(place: Path) -> Iterator[Path]:
    """The same, while no other test runs LinuxCNC."""
    with alone():
        yield place


@pytest.mark.nightly
@IN_LINUXCNC
def test_the_contour_of_a_circle_is_compensated(installed: Path) -> None:
    samples = contour.run_cases("circle", installed, USER)
    errors = {case: one.contour().figures()["contour_rms_um"] for case, one in samples.items()}
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
    done = halrun(
        installed, f"loadrt hsep axes={installed}/hal/x", f"loadrt hsep_predictor axes={installed}/hal/emps", "show pin"
    )
    assert {"hsep.x.out", "hsep_predictor.emps.predicted"} <= set(done.stdout.split()), done.stderr
    for given, said in {
        f"hsep axes={installed}/hal/z": f"there is no {installed}/hal/z/variables.bin; an axis is a folder that",
        f"hsep axes={installed}/hal/emps": "another kind of FMU",
        f"hsep_predictor axes={installed}/hal/x": "hybridsep hal MACHINE --predictor",
        f"hsep axes={installed}/hal/x,{installed}/hal/x": "a name of its own, got x twice",
    }.items():
        done = halrun(installed, f"loadrt {given}")
        assert said in " ".join(done.stderr.split()), done.stderr
        assert done.returncode != 0


@pytest.mark.nightly
@IN_LINUXCNC
def test_an_axis_begins_without_compensation_and_with_the_machine_files_model(installed: Path) -> None:
    changes = ('name = "x"', 'name = "careful"'), ("[compensator]\n", '[compensator]\ncompensate = "physics"\n')
    file = changed_machine(installed / "careful.toml", AXES[0], *changes)
    contour.hybridsep("hal", str(file), "--out", str(installed / "hal"))
    for name, model in (("x", "2"), ("careful", "1")):
        shown = [f"getp hsep.{name}.model", f"getp hsep.{name}.enable"]
        done = halrun(installed, f"loadrt hsep axes={installed}/hal/{name}", *shown)
        assert done.stdout.split()[-2:] == [model, "FALSE"], done.stdout


def halrun(place: Path, *lines: str) -> subprocess.CompletedProcess[str]:
    """Run lines of HAL as the ordinary user."""
    loaded, home = place / "given.hal", place / "home"
    loaded.write_text("".join(f"{line}\n" for line in lines))
    home.mkdir(exist_ok=True)
    shutil.chown(home, USER)
    command = ["runuser", "-u", USER, "--", "env", f"HOME={home}", "halrun", "-f", str(loaded)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60.0)


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
    table[:, sampled_columns.COLUMNS.index("x_fb")] = 10.0 * np.sin(2e-3 * (np.arange(n) - 5))
    np.savetxt(tmp_path / "samples.txt", table, header=" ".join(sampled_columns.COLUMNS), comments="", fmt="%.6f")
    reading = ("--x_d", "x_out", "--x", "x_fb", "--unit", "mm", "--T_s", "0.001")
    hybridsep.done("backtest", str(tmp_path / "samples.txt"), "--machine", AXES[0], *reading)
