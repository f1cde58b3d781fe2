"""Logs as recorders write them: by the format's library, or after the maker's document.

Samples of columns may have rates of their own: ``{"x_d": (T_s, values), …}``.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from hybridsep.base.signals import Array

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
    """Return a trace of SINUMERIK Operate.

    Signals are first time, interval and samples by name, ``nckServoDataCmdPos2ndEnc64 [u1, 7]``. Values that are as
    before are left out, and records without any.
    """
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
    times; otherwise they are milliseconds; ``shared``: whether neighbours that are sampled alike share a column of
    times.
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
    lines += [
        row("SampleTime[ms]", {name: number(1e3 * T_s).removesuffix(",0") for name, (T_s, _) in channels.items()})
    ]
    lines += [
        row("SymbolName", {name: f"MAIN.{name}" for name in channels}),
        row("Unit", dict.fromkeys(channels, unit)),
        "",
    ]
    for k in range(max(len(values) for _, values in channels.values())):
        cells = []
        for group in groups:
            T_s, values = channels[group[0]]
            inside = k < len(values)
            cells += [time(k, T_s) if inside else ""]
            cells += [number(channels[name][1][k]) if inside else "" for name in group]
        lines.append(mark.join(cells).rstrip(mark))
    return "\n".join([*lines, "EOF"]) + "\n"
