"""LinuxCNC halscope's CSV, since version 2.9: ``write_log_file`` of LinuxCNC's ``src/hal/utils/scope_files.c``."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from ..base.errors import LogError
from .source import Block
from .text import TextSource, split, with_own_names

_PERIOD = re.compile(rb"#\s*Sampling period is\s+(-?\d{1,18})\s+ns\s")  # first line

_TIME = "t"  # name of the time column, which is made from the period

_COMMANDED, _MEASURED = ("motor-pos-cmd", "pos-cmd"), ("motor-pos-fb", "pos-fb")
"""Ends of the names of HAL pins with positions of a joint, at the motor first: between the two lies the servo."""

_UNIT = "halscope states no unit: positions are in the machine's, which unit='mm' or 'in' (--unit) says"


class HalscopeSource(TextSource):
    """Channels of halscope: the period in a comment, names, then numbers between semicolons; joints by their pins."""

    format = "LinuxCNC halscope"
    endings: ClassVar[tuple[str, ...]] = (".csv", ".log")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            match, header = _PERIOD.match(file.readline()), file.readline().decode("utf-8", "replace")
        period = int(match[1]) if match else 0
        if period <= 0:
            raise LogError(f"{path}, line 1: the sampling period must be a positive number of ns, got {period}")
        self._period = period / 1e9
        names = split(header.rstrip("\r\n"), ";")
        # Positions and scales of the screen stand in comments between names and numbers
        self._table = replace(self._table, names=names, units={}, header=2)
        own, self.twins = with_own_names(names)
        self.units, self.roles, self.remarks, self.axes = {}, {"t": _TIME}, [_UNIT], {}
        self.names = [*own, _TIME] if _TIME not in own else own
        for commanded, measured in zip(_COMMANDED, _MEASURED, strict=True):
            for name in own:
                joint = name.removesuffix(f".{commanded}")
                if joint != name and f"{joint}.{measured}" in own:
                    self.axes.setdefault(joint, (name, f"{joint}.{measured}"))

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with the period in a comment."""
        return _PERIOD.match(head) is not None

    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``."""
        own = [name for name in names if name != _TIME] or self.names[:1]
        block = super().read(own)
        found = dict(zip(own, block.columns, strict=True))
        t = self._period * np.arange(len(block.columns[0]), dtype=np.float64)
        return Block([t if name == _TIME else found[name] for name in names], block.where)
