"""Writes small logs in every format, for the tests of the readers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import io

__all__ = ["FORMATS", "Columns", "columns", "write", "write_csv"]

Columns = dict[str, Any]


def columns(n: int = 50, T_s: float = 1e-3) -> Columns:
    t = np.arange(n) * T_s
    return {"t": t, "x_d": np.sin(t), "x": 0.9 * np.sin(t)}


def write_csv(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def write(path: Path, data: Columns) -> Path:
    """Write a log in the format of the extension, exactly."""
    if path.suffix == ".npz":
        np.savez(path, **data)
    elif path.suffix == ".mat":
        io.savemat(path, data)
    else:
        rows = zip(*data.values(), strict=True)
        text = "\n".join([",".join(data), *(",".join(map(repr, map(float, row))) for row in rows)])
        write_csv(path, text + "\n")
    return path


FORMATS = pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat"])
