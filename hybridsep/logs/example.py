"""The example log that ships with the package, made by ``examples/example_log.py`` of the repository."""

from __future__ import annotations

import gzip
from pathlib import Path

from ..base.output import written_whole

__all__ = ["EXAMPLE", "HEAD", "write_example"]

EXAMPLE = Path(__file__).with_name("example_axis.csv.gz")
"""The log, 20 s of a simulated axis at 1 kHz."""

HEAD = """# example log of hybridsep: a simulated ball-screw axis, 20 s at 1 kHz
t [s],x_d [mm],x_meas [mm]"""
"""Its first lines."""


def write_example(path: Path) -> None:
    """Write the example log as CSV, or compressed where the name ends in ``.gz``."""
    packed = EXAMPLE.read_bytes()
    with written_whole(path) as file:
        file.write(packed if path.suffix == ".gz" else gzip.decompress(packed))
