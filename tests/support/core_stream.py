"""A model of the C core as a stream."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from c_core import TABLES, CModel, RefusedError
from stream import OUTPUTS, Array, RefusedStreamError, Value, kind_of, table_of_model

from hybridsep.base.state import pack, unpack


class CoreStream:
    """The C core through ctypes, as an adapter holds it: the block of its state beside the values.

    Parameters
    ----------
    model : str
    resources : Path
        Folder of the files that the model reads.
    warm : bool
        Whether the folder has learned weights, so that no warm-up is needed.
    """

    def __init__(self, model: str, resources: Path, *, warm: bool = False) -> None:
        TABLES.setdefault(model, table_of_model(model))
        self.model = model
        self._kind = f"core {model}"
        self._start = {"t_init": 0.0} if warm else {}
        self._resources = resources
        self.reset()
        self._outputs = OUTPUTS[kind_of(model)]
        self._warnings: list[str] = []

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._take(values)
        self._refusing(self._core.initialise, start)

    def outputs_before(self, values: Mapping[str, Value]) -> list[float]:
        self._take(values)
        self._refusing(self._core.start_values)
        return self.outputs()

    def set(self, name: str, value: Value) -> None:
        self._core[name] = float(value)

    def set_slope(self, name: str, slope: float) -> None:
        self._core.values[self._core.slope_place[name]] = slope

    def step(self, t: float, h: float) -> None:
        self._refusing(self._core.step, t, h)
        if self._core.warning:
            self._warnings.append(self._core.warning)

    def outputs(self) -> list[float]:
        return [self._core[name] for name in self._outputs]

    def window(self, name: str) -> Array:
        return self._core.window(name)

    def save(self) -> bytes:
        return pack(self._kind, {}, {"state": self._core.state.view(np.float64), "values": self._core.values})

    def restore(self, blob: bytes) -> None:
        _, arrays, _ = unpack(self._kind, blob)
        before = self._core.values
        self._core.values = arrays["values"].copy()
        try:
            self._refusing(self._core.check_state, arrays["state"].tobytes())
        except RefusedStreamError:
            self._core.values = before
            raise
        self._core.state = arrays["state"].copy()

    def reset(self) -> None:
        self._core = CModel(self.model, self._start, self._resources)

    def warnings(self) -> list[str]:
        return self._warnings

    def close(self) -> None:
        pass

    def _take(self, values: Mapping[str, Value]) -> None:
        for name, value in values.items():
            self._core[name] = float(value)

    @staticmethod
    def _refusing(function: Callable[..., Any], *arguments: Any) -> None:
        try:
            function(*arguments)
        except RefusedError as error:
            raise RefusedStreamError(str(error)) from error
