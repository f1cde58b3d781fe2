"""Columns of a log: which are read, in which units, and what is said where that cannot be known."""

import json
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import capture, columns, refused, write, write_csv

from hybridsep.base.errors import LogError, first_line, listed
from hybridsep.logs.columns import channels
from hybridsep.logs.formats import open_source
from hybridsep.logs.log import read_log
from hybridsep.logs.units import position_unit


@pytest.mark.parametrize(
    ("measured", "names", "read"),
    [
        (("x_meas",), {}, "x_meas"),
        (("x", "x_meas"), {}, "x_meas"),
        (("x", "x_meas"), {"x": "x"}, "x"),
        (("x_meas", "x_enc"), {"x": "x_enc"}, "x_enc"),
    ],
)
def test_which_column_is_the_measured_position(
    tmp_path: Path, measured: tuple[str, ...], names: dict[str, str], read: str
) -> None:
    """Where the true position is x and the measured one x_meas, the latter is meant unless a name is given."""
    data = {name: columns()[name] for name in ("t", "x_d")} | {name: np.full(50, float(len(name))) for name in measured}
    path = write(tmp_path / "log.npz", data)
    np.testing.assert_array_equal(read_log(path, columns=names).x_meas, np.full(50, float(len(read))))


def test_missing_columns(tmp_path: Path) -> None:
    data = columns()
    path = write(tmp_path / "log.npz", {"x_d": data["x_d"], "qm": data["x"]})
    message = r"columns 't', 'x' are missing, the file has 'x_d', 'qm'; name them: --t NAME --x NAME \(or --T_s"
    refused(message, path)
    refused(r"column 'x' is missing, the file has 'x_d', 'qm'; name it: --x NAME", path, T_s=1e-3)
    refused(r"column 'time' \(t\) is missing", path, columns={"t": "time", "x": "qm"}, T_s=1e-3)
    refused(r"columns may name t, x_d, x, error, got 'y'", path, columns={"y": "qm"})


def test_column_named_twice(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "t,x,x_d,x\n0,1,2,1\n1,3,4,\n2,5,6,7\n")
    refused(r"line 3: column 'x' occurs 2 times, with different values, 3 and nan; rename", path)
    path = write_csv(tmp_path / "log.csv", "t;x_d;t;x\n0;1;0;3\n1;1;1;3\n2;1;2,5;3\n")
    refused(r"line 4: column 't' occurs 2 times, .* 2 and 2.5; export all channels with", path)
    assert read_log(path, columns={"t": "t#2"}).t.tolist() == [0.0, 1.0, 2.5]
    twice = {"t": np.arange(3.0), "x_d": np.arange(3.0), "x": np.arange(3.0)}
    with zipfile.ZipFile(write(tmp_path / "log.npz", twice), "a") as archive, pytest.warns(UserWarning, match="Dup"):
        archive.writestr("x.npy", archive.read("x.npy"))
    refused("column 'x' must occur once, got 2", tmp_path / "log.npz")


def test_a_time_beside_each_channel(tmp_path: Path) -> None:
    """As TwinCAT Scope exports it."""
    head = "Name;Scope\nFile;C:\\x.tcscopex\nStarttime of export;133500000000\n\n"
    rows = "".join(f"{k};{k / 8:g};{k};{k / 4:g}\n".replace(".", ",") for k in range(30))
    names = {"x_d": "SetPos", "x": "ActPos"}
    for header in ("Time [ms];SetPos;Time [ms];ActPos\n", "Time;SetPos;Time;ActPos\nms;m;ms;m\n"):
        log = read_log(write_csv(tmp_path / "log.csv", head + header + rows), columns=names)
        assert log.T_s == 1e-3
        np.testing.assert_array_equal(log.x_meas, np.arange(30) / 4)
    stamps = "".join(f"12:00:0{k}.5;{k};12:00:0{k}.5;{k}\n" for k in range(9))
    assert read_log(write_csv(tmp_path / "log.csv", f"Uhr;x_d;Uhr;x\n{stamps}")).T_s == 1.0


@pytest.mark.parametrize("name", ["trace.t", "trace.time [s]", "trace.tout", "t", "tick"])
def test_columns_in_a_struct_are_guessed_beside_those_that_are_named(tmp_path: Path, name: str) -> None:
    """A time that was named kept the positions from being found; ``trace.t`` was no time."""
    data = columns()
    text = {name: data["t"], "trace.pos.set_mm": data["x_d"], "trace.pos.act_mm": data["x"], "trace.iq": data["x"]}
    path = write(tmp_path / "log.csv", text)
    log = read_log(path, columns={"t": name} if name == "tick" else None)
    np.testing.assert_allclose((log.t, log.x_d, log.x_meas), (data["t"], 1e-3 * data["x_d"], 1e-3 * data["x"]))
    for role, other in (("x_d", "trace.iq"), ("x", "trace.iq"), ("x_d", "trace.pos.set_mm")):
        named = read_log(path, columns={role: other, **({"t": name} if name == "tick" else {})}, unit="mm")
        assert {"x_d": "trace.pos.act_mm", "x": "trace.pos.set_mm"}[role] in named.columns.values()


@pytest.mark.parametrize("unit", ["km", "0um", "furlong", 1e-3, b"mm", ["mm"]])
def test_units_that_are_none(tmp_path: Path, unit: Any) -> None:
    path = write(tmp_path / "log.npz", columns())
    with pytest.raises(LogError, match=f"unit must be one of m, mm, .*, got {re.escape(repr(unit))}; a multiple is"):
        read_log(path, unit=unit)
    np.testing.assert_allclose(read_log(path, unit="0.1um").x_d, 1e-7 * columns()["x_d"])
    assert read_log(path, unit="1e-4 deg").unit == "rad"


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [("cm", 1e-2, "m"), ("mils", 2.54e-5, "m"), ("arcsec", np.pi / 648e3, "rad"), ("rev", 2 * np.pi, "rad")],
)
def test_units(tmp_path: Path, unit: str, factor: float, si: str) -> None:
    log = read_log(write_csv(tmp_path / "log.csv", f"t,x_d ({unit}),x [{unit}]\n0,1,2\n1,3,4\n"))
    np.testing.assert_allclose(log.x_meas, [2 * factor, 4 * factor], rtol=1e-15)
    assert (log.unit, log.unit_stated) == (si, True)
    assert position_unit(log.file_unit) == position_unit(unit)


def test_an_index_is_told_from_time(tmp_path: Path) -> None:
    rows = "".join(f"{i},{i},{i}\n" for i in range(20))
    path = write_csv(tmp_path / "log.csv", "t,x_d,x\n" + rows)
    message = r"column 't' counts samples: it is an index, or a time in ms; give T_s \(--T_s 0.001\), or .*'t \[ms\]'"
    refused(message, path)
    named = write_csv(tmp_path / "us.csv", "# us,a,b\n# ----\n" + rows)
    refused(r"us \[us\]", named, columns={"t": "us", "x_d": "a", "x": "b"})
    log = read_log(path, T_s=2e-3)
    np.testing.assert_allclose(log.t, 2e-3 * np.arange(20))
    assert read_log(write_csv(path, "t [ms],x_d,x\n" + rows)).T_s == 1e-3
    assert read_log(write_csv(path, "t [s],x_d,x\n" + rows)).T_s == 1.0
    assert read_log(write_csv(path, "index,x_d,x\n" + rows), T_s=2e-3).T_s == 2e-3
    refused(r"column 't' is missing, the file has 'index', 'x_d', 'x'; name it: --t NAME", path)


def test_a_given_unit_must_not_contradict_the_names(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "t,x_d [mm],x [mm]\n0,1,2\n1,3,4\n")
    refused(r"unit='um' \(--unit um\) was given, but column 'x_d \[mm\]' states 'mm'", path, unit="um")
    assert read_log(path, unit="mm").x_d[1] == read_log(path, unit="millimetre").x_d[1] == 3e-3
    refused(r"axis 'X1' is missing; no names tell axes: name the columns, --x_d and --x", path, axis="X1")


def test_counts_are_read_with_their_length(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "t,x_d [counts],x [inc]\n0,10,20\n0.001,30,40\n")
    np.testing.assert_allclose(read_log(path, unit="0.1um").x_meas, [2e-6, 4e-6])
    path = write_csv(tmp_path / "log.csv", "t;x_d;x\ns;0.1um;0.1um\n0;10;20\n0.001;30;40\n")
    np.testing.assert_allclose(read_log(path).x_meas, [2e-6, 4e-6])


def test_columns_that_were_recognised_are_said(tmp_path: Path) -> None:
    text = "t [s],X_cmd [mm],X_act [mm],Y_cmd [mm],Y_act [mm]\n0,1,2,3,4\n0.001,1,2,3,4\n"
    path = write_csv(tmp_path / "log.csv", text)
    axis, remark = read_log(path).remarks
    assert axis == "axis X of X, Y is read; axis='…' (--axis) chooses another"
    assert remark.startswith("columns 'X_cmd [mm]' and 'X_act [mm]' are read as the commanded and the measured")
    assert read_log(write_csv(path, "t,x_d [mm],x_meas\n0,1,2\n1,1,2\n")).remarks == ()


def test_channels_that_cannot_be_read_are_listed(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "clock,note,x [mm],force\n0,a,1,\n0.5,b,2,\n1,c,3,\n")
    listed = [(one.name, one.unit, one.role) for one in channels(open_source(path))]
    assert listed == [("clock", "", ""), ("note", "", ""), ("x [mm]", "mm", "x"), ("force", "", "")]
    path = write_csv(tmp_path / "log.csv", "a,b\nc,d\n")
    assert [one.name for one in channels(open_source(path))] == ["a", "b"]


LONG = "x" * 100_000
MANY = [f"column {i}" for i in range(1000)]


@pytest.mark.parametrize(
    "text",
    [
        f"t,x_d,x\n0,0,0\n1,{LONG},0\n",
        f"t,x_d,{LONG}\n0,0,0\n1,0,0\n",
        f"{','.join(MANY)}\n{','.join('1' * 1000)}\n",
        f"t [{LONG}],x_d,x\n0,0,0\n1,0,0\n",
        f"time,x_d,x\n12:00:00.0,0,0\n12:00:00.1,0,0\n{LONG},0,0\n",
        json.dumps(capture({"CYCLE": np.arange(50), "DES_POS|1": np.arange(50)}, [LONG] * 2)),
    ],
    ids=["value", "name", "names", "unit", "timestamp", "json"],
)
def test_what_a_message_quotes_is_cut(tmp_path: Path, text: str) -> None:
    path = write_csv(tmp_path / "log", text)
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert len(str(caught.value).replace(str(path), "")) < 700
    assert "\n" not in str(caught.value)


def test_columns_that_are_there_are_counted(tmp_path: Path) -> None:
    path = write(tmp_path / "log.npz", dict.fromkeys(MANY, np.zeros(9)))
    refused(r"the file has 'column 0', .*, 'column 11' … and 988 more; name them: --t NAME", path)
    with pytest.raises(LogError, match=rf"axis '{'y' * 59}… \(1002 characters\) is missing; no names tell axes"):
        read_log(write(tmp_path / "log.csv", columns()), axis="y" * 1000)


def test_cuts() -> None:
    assert listed([]) == "none"
    assert listed(["a", 2]) == "'a', 2"
    assert first_line(ValueError("one\ntwo")) == "one"
    assert first_line(KeyError()) == "KeyError"
    assert len(first_line("z" * 1000)) == 201
