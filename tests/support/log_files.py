"""Writes small logs in every format, by the format's library, or after its maker's document.

Samples of columns may have rates of their own: ``{"x_d": (T_s, values), …}``.
"""

import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy import io

from hybridsep.base.errors import LogError
from hybridsep.base.signals import Array
from hybridsep.logs.log import read_log

Columns = dict[str, Any]


Rated = Mapping[str, tuple[float, Array]]  # sampling interval, s, and values by column


def write_parquet(path: Path, data: Mapping[str, Any]) -> Path:
    """Write a Parquet file in row groups."""
    pq.write_table(pa.table(dict(data)), path, row_group_size=20)
    return path


def halscope_csv(data: Mapping[str, Any], period_ns: int = 1_000_000) -> str:
    """Return halscope's CSV as ``write_log_file`` of LinuxCNC 2.9 and later writes it, with all digits."""
    lines = [f"# Sampling period is {period_ns} ns", ";".join(data)]
    lines += ["# Position: " + ";".join(["0.500000"] * len(data)), "# Scale: " + ";".join(["0"] * len(data))]
    lines += [";".join(repr(float(x)) for x in row) for row in zip(*data.values(), strict=True)]
    return "\n".join(lines) + "\n"


def trace_xml(signals: Mapping[str, tuple[float, float, Array]], kind: str = "posn") -> str:
    """Return a trace of SINUMERIK Operate."""
    # Signals are first time, interval and samples by name, nckServoDataCmdPos2ndEnc64 [u1, 7]. Values that are as
    # before are left out, and records without any
    declared, changes = [], dict[float, dict[str, float]]()
    for i, (name, (start, interval, values)) in enumerate(signals.items(), 1):
        declared.append(
            f'  <dataSignal domain="NCU_1" interval="{interval:.6f}" id="f{i}" event="255" eventChannel="1" '
            f'datapointCount="{len(values)}" key="s{i}" name="/Nck/!SD/{name}" unitsType="{kind}" dataType="double"/>'
        )
        for k, value in enumerate(values):
            if k == 0 or value != values[k - 1]:
                changes.setdefault(round(start + k * interval, 6), {})[f"f{i}"] = float(value)
    end = max(start + interval * (len(values) - 1) for start, interval, values in signals.values())
    changes.setdefault(round(end, 6), {})
    records = [
        f'  <rec time="{t:.6f}"' + "".join(f' {key}="{value!r}"' for key, value in sorted(values.items())) + "/>"
        for t, values in sorted(changes.items())
    ]
    head = '<?xml version="1.0" encoding="utf-8" ?>\n<traceSession version="01.00.03.02">\n'
    frame = ' <dataFrame>\n  <frameHeader startTime="2026-04-15T10:00:00" stopInc="0"/>\n'
    body = "\n".join([*declared, *records])
    return f"{head}<traceData>\n{frame}{body}\n </dataFrame>\n</traceData>\n</traceSession>\n"


def twincat_csv(
    channels: Rated, *, mark: str = "\t", unit: str = "m (Length)", full: bool = False, shared: bool = False
) -> str:
    """Return an export of TwinCAT Scope as Beckhoff's manual describes it.

    ``mark``: between fields; numbers have a decimal comma unless it is one; ``full``: whether times are Windows file
    times, else milliseconds; ``shared``: whether neighbours that are sampled alike share a column of times.
    """
    start = 132_959_733_843_760_000

    def number(x: float) -> str:
        return repr(float(x)) if mark == "," else repr(float(x)).replace(".", ",")

    def time(k: int, T_s: float) -> str:
        return str(start + round(k * T_s * 1e7)) if full else number(round(1e3 * k * T_s, 9))

    groups: list[list[str]] = []
    for name, (T_s, _) in channels.items():
        if shared and groups and channels[groups[-1][0]][0] == T_s:
            groups[-1].append(name)
        else:
            groups.append([name])

    def row(key: str, values: Mapping[str, str]) -> str:
        return mark.join(mark.join([key, *(values[name] for name in group)]) for group in groups)

    lines = [f"Name{mark}scope", f"File{mark}scope.csv"]
    lines += [f"Starttime of export{mark}{start}{mark}Montag, 2. Mai 2022{mark}15:56:24.376"]
    lines += [f"Endtime of export{mark}{start + 10**7}{mark}Montag, 2. Mai 2022{mark}15:56:25.375", ""]
    lines += ["", row("Name", {name: name for name in channels})]
    lines += [row("SampleTime[ms]", {one: number(1e3 * T_s).removesuffix(",0") for one, (T_s, _) in channels.items()})]
    lines += [row("SymbolName", {name: f"MAIN.{name}" for name in channels})]
    lines += [row("Unit", dict.fromkeys(channels, unit)), ""]
    for k in range(max(len(values) for _, values in channels.values())):
        cells = []
        for group in groups:
            T_s, values = channels[group[0]]
            inside = k < len(values)
            cells += [time(k, T_s) if inside else ""]
            cells += [number(channels[name][1][k]) if inside else "" for name in group]
        lines.append(mark.join(cells).rstrip(mark))
    return "\n".join([*lines, "EOF"]) + "\n"


def columns(n: int = 50, T_s: float = 1e-3) -> Columns:
    t = np.arange(n) * T_s
    return {"t": t, "x_d": np.sin(t), "x": 0.9 * np.sin(t)}


def write_csv(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_text(text, encoding=encoding, newline="")
    return path


def capture(data: Columns, axes: Sequence[str] = ()) -> dict[str, Any]:
    """Return what a Siemens recording of these signals holds, its rows in two entries with an event between them."""
    names = list(axes) or ["Cycle"] * len(data)
    signals = [
        {"Name": name, "Type": "DOUBLE", "Axis": axis, "Address": name} for name, axis in zip(data, names, strict=True)
    ]
    rows = [list(map(float, row)) for row in zip(*(np.ravel(column) for column in data.values()), strict=True)]
    event = {"HFBlockEvent": {"HFProbeCounter": 5, "GCode": "G1"}}
    payload = [{"HFData": rows[:20]}, event, {"LFData": []}, {"HFData": rows[20:]}]
    return {"Header": {"CycleTimeMs": 2, "SignalListHFData": signals}, "Payload": payload, "Footer": {}}


def write(path: Path, data: Columns) -> Path:
    """Write a log in the format of the extension, exactly."""
    if path.suffix == ".npz":
        np.savez(path, **data)
    elif path.suffix == ".mat":
        io.savemat(path, data)
    elif path.suffix == ".json":
        path.write_text(json.dumps(capture(data)))
    elif path.suffix in _RECORDERS:
        _RECORDERS[path.suffix](path, {name: np.ravel(values) for name, values in data.items()})
    else:
        rows = zip(*data.values(), strict=True)
        text = "\n".join([",".join(data), *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n"
        path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def refused(message: str, recording: Any, **how: Any) -> None:
    """Check that a log is refused with a message."""
    with pytest.raises(LogError, match=message):
        read_log(recording, **how)


def _rated(data: Columns) -> dict[str, tuple[float, Any]]:
    return {name: (float(data["t"][1] - data["t"][0]), values) for name, values in data.items() if name != "t"}


_RECORDERS: dict[str, Callable[[Path, Columns], object]] = {
    ".parquet": write_parquet,
    ".xml": lambda path, data: path.write_text(
        trace_xml({name: (float(data["t"][0]), *rated) for name, rated in _rated(data).items()}, kind="none")
    ),
    ".scope": lambda path, data: path.write_text(twincat_csv(_rated(data))),
    ".hal": lambda path, data: path.write_text(halscope_csv({name: data[name] for name in data if name != "t"})),
}
"""Writers of recorders' formats."""

FORMATS = pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat"])
EVERY_FORMAT = pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".npz", ".mat", ".json", *_RECORDERS])
