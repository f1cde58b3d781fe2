"""Messages about logs: what they quote of the file is cut."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import capture, columns, write, write_csv

from hybridsep.base.errors import LogError, first_line, listed
from hybridsep.logs.log import read_log

LONG = "x" * 100_000
MANY = [f"column {i}" for i in range(1000)]


def recording(**changes: Any) -> str:
    content = capture({"CYCLE": np.arange(50), "DES_POS|1": np.arange(50), "ENC_POS|1": np.arange(50)}, [LONG] * 3)
    content["Header"] |= changes
    return json.dumps(content)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("log.csv", f"t,x_d,x\n0,0,0\n1,{LONG},0\n"),
        ("log.csv", f"t,x_d,{LONG}\n0,0,0\n1,0,0\n"),
        ("log.csv", f"{','.join(MANY)}\n{','.join('1' * 1000)}\n"),
        ("log.csv", f"t [{LONG}],x_d,x\n0,0,0\n1,0,0\n"),
        ("log.csv", f"t,x_d,x [{LONG}]\n0,0,0\n1,0,0\n"),
        ("log.csv", f"time,x_d,x\n12:00:00.0,0,0\n12:00:00.1,0,0\n{LONG},0,0\n"),
        ("log.json", recording(CycleTimeMs=LONG)),
        ("log.json", recording(SignalListHFData=[[LONG] * 100])),
        ("log.json", recording(SignalListHFData=[{"Name": name, "Axis": LONG} for name in MANY])),
        ("log.json", recording().replace("[0.0,", f'["{LONG}",', 1)),
    ],
)
def test_what_a_message_quotes_is_cut(tmp_path: Path, name: str, text: str) -> None:
    path = write_csv(tmp_path / name, text)
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert len(str(caught.value).replace(str(path), "")) < 700
    assert "\n" not in str(caught.value)


def test_columns_that_are_there_are_counted(tmp_path: Path) -> None:
    path = write(tmp_path / "log.npz", dict.fromkeys(MANY, np.zeros(9)))
    with pytest.raises(LogError, match=r"the file has 'column 0', .*, 'column 11' … and 988 more; name them: --t NAME"):
        read_log(path)
    with pytest.raises(LogError, match=rf"axis '{'y' * 59}… \(1002 characters\) is missing; no names tell axes"):
        read_log(write(tmp_path / "log.csv", columns()), axis="y" * 1000)


def test_cuts() -> None:
    assert listed([]) == "none"
    assert listed(["a", 2]) == "'a', 2"
    assert first_line(ValueError("one\ntwo")) == "one"
    assert first_line(KeyError()) == "KeyError"
    assert len(first_line("z" * 1000)) == 201
