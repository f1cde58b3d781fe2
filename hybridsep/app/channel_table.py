"""Table of a log's channels, for ``--list-channels``."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich import box
from rich.table import Table

from ..logs.columns import channels
from ..logs.formats import open_source
from ..logs.source import Channel
from .tables import console, print_json

__all__ = ["print_channels"]

_ROLES = {"t": "time", "x_d": "commanded", "x": "measured"}


def print_channels(logs: Sequence[Path], *, as_json: bool) -> None:
    """Print what files hold: names, units, samples, rates, and what is read without a word.

    Raises
    ------
    LogError
        If a file cannot be read.
    """
    found = {str(path): channels(open_source(path)) for path in logs}
    if as_json:
        print_json({path: [asdict(one) for one in listed] for path, listed in found.items()})
        return
    for path, listed in found.items():
        table = Table("channel", "unit", "samples", "interval [s]", "read as", title=path, box=box.SIMPLE)
        for one in listed:
            table.add_row(*_cells(one))
        console.print(table)
        missing = [role for role in _ROLES if role != "t" and role not in {one.role for one in listed}]
        if missing and not all(one.role for one in listed):
            words = " and ".join(_ROLES[role] for role in missing)
            options = " ".join(f"--{role} NAME" for role in missing)
            console.print(
                f"none is read as the {words} position; name it: hybridsep fit {shlex.quote(path)} {options}",
                soft_wrap=True,
            )


def _cells(one: Channel) -> tuple[str, ...]:
    n = "" if one.n_samples is None else str(one.n_samples)
    interval = "" if one.interval is None else f"{one.interval:.9g}"
    return one.name, one.unit, n, interval, _ROLES.get(one.role, "")
