"""Writes small logs in every format, for the tests of the readers."""

import gzip
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorders import halscope_csv, trace_xml, twincat_csv, write_parquet
from scipy import io

Columns = dict[str, Any]


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


def _rated(data: Columns) -> dict[str, tuple[float, Any]]:
    return {name: (float(data["t"][1] - data["t"][0]), values) for name, values in data.items() if name != "t"}


def _traced(data: Columns) -> dict[str, tuple[float, float, Any]]:
    return {name: (float(data["t"][0]), *rated) for name, rated in _rated(data).items()}


def _positions(data: Columns) -> Columns:
    return {name: values for name, values in data.items() if name != "t"}


_RECORDERS: dict[str, Callable[[Path, Columns], object]] = {
    ".parquet": write_parquet,
    ".xml": lambda path, data: path.write_text(trace_xml(_traced(data), kind="none")),
    ".scope": lambda path, data: path.write_text(twincat_csv(_rated(data))),
    ".hal": lambda path, data: path.write_text(halscope_csv(_positions(data))),
}
"""Writers of recorders' formats."""

FORMATS = pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat"])
EVERY_FORMAT = pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".npz", ".mat", ".json", *_RECORDERS])
