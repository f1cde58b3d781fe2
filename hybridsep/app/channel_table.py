"""Table of a log's channels, for ``--list-channels``."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

from rich import box
from rich.table import Table

from ..base.errors import LogError
from ..logs.columns import roles_of
from ..logs.formats import channels, open_source
from ..logs.log import open_log
from ..logs.source import Channel
from ..logs.units import stated_unit
from .tables import console, print_json

__all__ = ["print_channels"]

_ROLES = {"t": "time", "x_d": "commanded", "x": "measured"}


def print_channels(logs: Sequence[Path], *, as_json: bool) -> None:
    """Print what files hold: names, units, samples and rates as far as the files state them.

    Raises
    ------
    LogError
        If a file cannot be read.
    """
    found = {str(path): _completed(path, channels(path)) for path in logs}
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
            options = " ".join(f"--{role.replace('_', '-')} NAME" for role in missing)
            console.print(
                f"none is read as the {words} position; name it: hybridsep fit {shlex.quote(path)} {options}",
                soft_wrap=True,
            )


def _completed(path: Path, listed: Sequence[Channel]) -> list[Channel]:
    """Return the channels of a file that states little of them, such as a text, with what reading it tells."""
    if any(one.role or one.n_samples is not None for one in listed):
        return list(listed)
    roles = {name: role for role, name in roles_of(open_source(path)).items()}
    n, T_s = None, None
    with suppress(LogError):  # whose columns must be named
        reader = open_log(path, uniform=False, may_miss=True)
        n, T_s = reader.n_samples, reader.T_s
    return [
        replace(one, unit=one.unit or stated_unit(one.name)[1], role=roles.get(one.name, ""), n_samples=n, interval=T_s)
        for one in listed
    ]


def _cells(one: Channel) -> tuple[str, ...]:
    n = "" if one.n_samples is None else str(one.n_samples)
    interval = "" if one.interval is None else f"{one.interval:.9g}"
    return one.name, one.unit, n, interval, _ROLES.get(one.role, "")
