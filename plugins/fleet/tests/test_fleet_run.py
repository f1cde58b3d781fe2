"""Runs of a fleet: rows as single fits and replays give them, and nothing twice."""

import io
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import fsspec
import numpy as np
import pytest
from fleet_stubs import Here
from log_files import capture, columns
from staircase_data import commanded, measured

from hybridsep.base.errors import StateError
from hybridsep.fitting.fit import fit
from hybridsep.fitting.replay import Recording, replay
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import load_machine, machine_path
from hybridsep.predict.predictor import HybridPredictor
from hybridsep_fleet.engine import Engine
from hybridsep_fleet.results import Results
from hybridsep_fleet.run import FleetRun, run_fleet
from hybridsep_fleet.settings import FleetSettings

DAYS = ("2026-03-05", "2026-03-06")


@contextmanager
def engine() -> Iterator[Engine]:
    yield Here()


@contextmanager
def no_engine() -> Iterator[Engine]:
    raise AssertionError("an engine was started")
    yield


def log(i: int, n: int = 300) -> bytes:
    part = slice(1000 * i + 50, 1000 * i + 50 + n)  # in motion
    text, rows = io.BytesIO(), np.column_stack((1e-3 * np.arange(n), commanded()[part], measured(i)[part]))
    np.savetxt(text, rows, delimiter=",", header="t,x_d,x", comments="", fmt="%.17g")
    return text.getvalue()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Logs of two machines on two days, one of them broken, and a machine file for each."""
    for i, (machine, day) in enumerate((machine, day) for machine in ("mill", "saw") for day in DAYS):
        path = tmp_path / "logs" / machine / day / "X.csv"
        path.parent.mkdir(parents=True)
        path.write_bytes(log(i))
        (tmp_path / "machines").mkdir(exist_ok=True)
        place = f"{machine}.toml" if machine == "mill" else f"{machine}/machine.toml"
        (tmp_path / "machines" / place).parent.mkdir(exist_ok=True)
        shutil.copy(machine_path("spring_mass_damper"), tmp_path / "machines" / place)
    (tmp_path / "logs" / "saw" / "broken.csv").write_text("t,x_d,x\n0,0,0\n0.001,a,0\n")
    return tmp_path


def run(folder: Path, *, source: str = "", idle: bool = False, **changed: object) -> FleetRun:
    given = {"machines": str(folder / "machines"), "reports": False, **changed}
    settings = FleetSettings(**given)  # type: ignore[arg-type]
    return run_fleet([source or str(folder / "logs")], folder / "out", settings, no_engine if idle else engine)


def test_rows_are_those_of_single_replays(folder: Path) -> None:
    found = run(folder)
    assert (found.n_logs, found.n_unchanged, len(found.rows), len(found.failed)) == (5, 0, 5, 1)
    assert "broken.csv, line 3: column 'x_d' must be a number, got 'a'" in found.failed[0]["message"]
    machine = load_machine("spring_mass_damper")
    for row in found.rows:
        if row["status"] == "done":
            one = read_log(row["url"])
            single = replay(
                HybridPredictor(machine.model, machine.predictor_settings), [Recording(one.x_d, one.x_meas, 0)]
            )
            assert [row["rms_pb"], row["rms_hold"], row["rms_h"]] == single.rms()
            assert (row["machine"], row["recorded"]) == tuple(Path(row["url"]).parts[-3:-1])
            assert row["n_samples"] == 300
    stored = Results(folder / "out").rows()
    assert sorted(row["key"] for row in stored) == sorted(row["key"] for row in found.rows)


def test_what_is_unchanged_is_left_alone(folder: Path) -> None:
    first = {row["url"]: row for row in run(folder).rows}
    again = run(folder, idle=True)
    assert (again.n_logs, again.n_unchanged, again.rows) == (5, 5, [])
    changed, moved = folder / "logs" / "mill" / DAYS[0] / "X.csv", folder / "logs" / "mill" / DAYS[1] / "X.csv"
    changed.write_bytes(log(4))
    moved = moved.rename(moved.with_name("Y.csv"))
    later = {row["url"]: row for row in run(folder).rows}
    assert set(later) == {str(changed), str(moved)}
    assert later[str(changed)]["rms_h"] != first[str(changed)]["rms_h"]
    before = first[str(moved.with_name("X.csv"))]
    assert (later[str(moved)]["key"], later[str(moved)]["seconds"]) == (before["key"], before["seconds"])  # as it was
    assert len(run(folder, unit="m").rows) == 5
    with (folder / "machines" / "saw" / "machine.toml").open("a") as file:
        file.write("# another\n")
    assert len(run(folder).rows) == 5


def test_a_run_that_was_killed_goes_on(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridsep_fleet.run._EVERY", 0.0)
    work = "hybridsep_fleet.task.work"

    class _KilledError(BaseException):
        pass

    from hybridsep_fleet.task import work as real

    worked: list[str] = []

    def killed(task: object) -> object:
        if len(worked) == 2:
            raise _KilledError
        worked.append("")
        return real(task)  # type: ignore[arg-type]

    monkeypatch.setattr(work, killed)
    with pytest.raises(_KilledError):
        run(folder)
    monkeypatch.setattr(work, real)
    assert len(run(folder).rows) == 3
    keys = [row["key"] for row in Results(folder / "out").rows()]
    assert len(keys) == len(set(keys)) == 5


def test_a_fit_is_that_of_fit(folder: Path) -> None:
    source = folder / "logs" / "mill" / DAYS[0]
    settings = FleetSettings(Np=20, fmus=False)
    (row,) = run_fleet([str(source)], folder / "out", settings, engine).rows
    single = fit(read_log(source / "X.csv"), Np=20).results()
    judged = single["judged"]
    assert {name: row[name] for name in ("rms_pb", "rms_hold", "rms_h", "ratio", "best", "verdict")} == {
        name: judged[name] for name in ("rms_pb", "rms_hold", "rms_h", "ratio", "best", "verdict")
    }
    assert json.loads(row["modes"]) == single["identification"]["modes"]
    made = {path.name for path in (folder / "out" / row["folder"]).iterdir()}
    assert made == {"machine.toml", "commands.csv", "trained.state", "fit.json", "report.html"}


def test_axes_of_a_log(folder: Path) -> None:
    x = columns(400)
    signals = {"CYCLE": np.arange(400.0), "DES_POS|1": x["x_d"], "ENC_POS|1": x["x"]}
    signals |= {"DES_POS|2": 2 * x["x_d"], "ENC_POS|2": 2 * x["x"]}
    path = folder / "capture" / "lathe.json"
    path.parent.mkdir()
    path.write_text(json.dumps(capture(signals, ["Cycle", "X1", "X1", "Z1", "Z1"])))
    found = run(folder, source=str(path), unit="mm")
    assert [(row["machine"], row["axis"]) for row in found.rows] == [("lathe", "X1"), ("lathe", "Z1")]
    assert all("there is no machine file for 'lathe': lathe_" in row["message"] for row in found.rows)
    assert [row["axis"] for row in run(folder, source=str(path), unit="mm", axes=("Z1",)).rows] == ["Z1"]


def test_an_object_store_gives_the_same(folder: Path) -> None:
    here = {row["key"]: row for row in run(folder).rows if row["status"] == "done"}
    shutil.rmtree(folder / "out")
    fsspec.filesystem("memory").put(str(folder / "logs"), "/runs/fleet", recursive=True)
    found = run(folder, source="memory://runs/fleet").rows
    assert run(folder, source="memory://runs/fleet", idle=True).rows == []
    there = {row["key"]: row for row in found if row["status"] == "done"}
    assert (len(found), len(there)) == (5, 4)
    for key, row in there.items():
        names = ("machine", "recorded", "rms_pb", "rms_hold", "rms_h", "ratio", "peers", "friction", "findings")
        assert {name: row[name] for name in names} == {name: here[key][name] for name in names}


def test_damaged_results(folder: Path) -> None:
    run(folder, source=str(folder / "logs" / "mill"))
    path = next((folder / "out" / "rows").iterdir())
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(StateError, match=r"\.parquet: is damaged: .*; remove it, its logs are fitted again"):
        run(folder)
