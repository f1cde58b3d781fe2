"""Options of the command line about channels: what a log holds, and rates that differ."""

import json
from pathlib import Path

from command_line import Run, write_log
from recorders import twincat_csv
from staircase_data import commanded, measured

from hybridsep.logs.log import read_log


def recording(path: Path) -> Path:
    """Write a command at 1 kHz, and a position and a torque at 500 Hz."""
    x_d, x = commanded()[:4000], measured(0)[:4000]
    path.write_text(twincat_csv({"x_d": (1e-3, x_d), "x": (2e-3, x[::2]), "torque": (2e-3, x[::2])}))
    return path


def test_channels_are_listed(tmp_path: Path, hybridsep: Run) -> None:
    path = recording(tmp_path / "log.csv")
    status, out, err = hybridsep("fit", path, "--list-channels")
    assert (status, err) == (0, "")
    rows = [line.split() for line in out.splitlines() if line.strip()]
    assert ["x_d", "m", "4000", "0.001", "commanded"] in rows
    assert ["torque", "m", "2000", "0.002"] in rows
    status, out, err = hybridsep("fit", path, "--list-channels", "--json")
    assert (status, err) == (0, "")
    listed = {one["name"]: one for one in json.loads(out)[str(path)]}
    assert listed["x"] == {"name": "x", "unit": "m", "role": "x", "n_samples": 2000, "interval": 0.002}
    assert [one.name for one in tmp_path.iterdir()] == ["log.csv"]
    odd = write_log(tmp_path / "odd.csv", n=20, header="t,goal,present")
    status, out, _ = hybridsep("fit", odd, "--list-channels")
    assert status == 0
    words = "none is read as the commanded and measured position; name it: hybridsep fit "
    assert f"{words}{odd} --x_d NAME --x NAME" in out


def test_rates_that_differ_are_said_and_resampled(tmp_path: Path, hybridsep: Run) -> None:
    path = recording(tmp_path / "log.csv")
    replay = ("backtest", path, "-m", "spring_mass_damper", "--json")
    status, _, err = hybridsep(*replay)
    assert status == 2
    assert "'x_d' has 4000 samples every 0.001 s, 'x' has 2000 samples every 0.002 s" in err
    assert "(--resample) takes both at the times of the slower one" in err
    status, _, err = hybridsep(*replay, "--resample")
    assert status == 2  # the machine has 1 kHz
    assert "sampled every 0.002 s, but machine spring_mass_damper has T_s = 0.001 s" in err
    assert len(read_log(path, resample=True).t) == 2000
