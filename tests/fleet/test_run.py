"""Runs of a fleet: rows as single fits and replays give them, and nothing twice."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import fsspec
import numpy as np
import pytest
from log_files import capture, columns
from s3_server import s3_server
from staircase_data import commanded, measured

from benchmarks.mutations import log_text
from hybridsep.base.errors import LogError, StateError
from hybridsep.fitting.fit import FitOptions, fit
from hybridsep.fitting.replay import Recording, replay
from hybridsep.fleet.results import Results
from hybridsep.fleet.run import FleetRun, run_fleet
from hybridsep.fleet.settings import FleetSettings
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import load_machine, machine_path
from hybridsep.parallel.engine import Engine, joblib_engine
from hybridsep.predict.predictor import HybridPredictor

DAYS = ("2026-03-05", "2026-03-06")


@contextmanager
def engine() -> Iterator[Engine]:
    yield joblib_engine(1)


@contextmanager
def no_engine() -> Iterator[Engine]:
    raise AssertionError("an engine was started")
    yield


def log(i: int, n: int = 300) -> bytes:
    part = slice(1000 * i + 50, 1000 * i + 50 + n)  # in motion
    return log_text({"t": 1e-3 * np.arange(n), "x_d": commanded()[part], "x": measured(i)[part]})


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


@pytest.mark.slow
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
    monkeypatch.setattr("hybridsep.fleet.run._EVERY", 0.0)
    work = "hybridsep.fleet.task.work"

    class _KilledError(BaseException):
        pass

    from hybridsep.fleet.task import work as real

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


@pytest.mark.slow
def test_a_fit_is_that_of_fit(folder: Path) -> None:
    source = folder / "logs" / "mill" / DAYS[0]
    settings = FleetSettings(Np=20, fmus=False)
    (row,) = run_fleet([str(source)], folder / "out", settings, engine).rows
    (folder / "single").mkdir()
    single = fit([read_log(source / "X.csv", uniform=False)], folder / "single", FitOptions(20, "X"), fmus=False)
    judged = single.summary()["judged"]
    assert {name: row[name] for name in ("rms_pb", "rms_hold", "rms_h", "ratio", "best", "verdict")} == {
        name: judged[name] for name in ("rms_pb", "rms_hold", "rms_h", "ratio", "best", "verdict")
    }
    assert json.loads(row["modes"]) == single.identification["modes"]
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


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("kind", ["memory", "s3"])
def test_an_object_store_gives_the_same(folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    here = {row["key"]: row for row in run(folder).rows if row["status"] == "done"}
    shutil.rmtree(folder / "out")
    with nullcontext("memory://runs") if kind == "memory" else s3_server(monkeypatch, "runs") as store:
        fsspec.core.url_to_fs(store)[0].put(str(folder / "logs"), "runs/fleet", recursive=True)
        found = run(folder, source=f"{store}/fleet").rows
        assert run(folder, source=f"{store}/fleet", idle=True).rows == []
    there = {row["key"]: row for row in found if row["status"] == "done"}
    assert (len(found), len(there)) == (5, 4)
    for key, row in there.items():
        names = ("machine", "recorded", "rms_pb", "rms_hold", "rms_h", "ratio", "peers", "friction", "findings")
        assert {name: row[name] for name in names} == {name: here[key][name] for name in names}


def test_damaged_results(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(folder, source=str(folder / "logs" / "mill"))
    path = next((folder / "out" / "rows").iterdir())
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(StateError, match=r"\.parquet: is damaged: .*; remove it, its logs are fitted again"):
        run(folder)
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(LogError, match=r"\.parquet: is Parquet, which needs the extra fleet: pip install"):
        Results(folder / "out").rows()


def test_without_its_extra_results_are_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = {"key": "k", "run": "2026-01-01T00:00:00", "n_samples": 3, "rms_h": 1e-6}
    monkeypatch.setattr("hybridsep.fleet.results.find_spec", lambda _name: None)
    Results(tmp_path).add([row])
    monkeypatch.undo()
    Results(tmp_path).add([{**row, "run": "2026-01-02T00:00:00"}])
    assert sorted(path.suffix for path in (tmp_path / "rows").iterdir()) == [".json", ".parquet"]
    first, second = Results(tmp_path).rows()
    assert {name: first[name] for name in row} == row
    assert {**first, "run": second["run"]} == second
    damaged = next((tmp_path / "rows").glob("*.json"))
    damaged.write_text("[{")
    with pytest.raises(StateError, match=r"\.json: is damaged: .*; remove it"):
        Results(tmp_path).rows()
