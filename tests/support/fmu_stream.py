"""An FMU as a stream."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from stream import OUTPUTS, Array, RefusedStreamError, Value, kind_of

from hybridsep.base.errors import FmuError
from hybridsep.cosim.fmu import FmuInstance


class FmuStream:
    """An FMU through fmpy."""

    def __init__(self, archive: Path, model: str) -> None:
        self.model = model
        self._outputs = OUTPUTS[kind_of(model)]
        self._fmu = FmuInstance(archive)
        # Of each type in one call: one by one they would take as long as the steps between
        self._read = self._fmu.reader(self._outputs)

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._refusing(self._fmu.begin, values, start_time=start, stop_time=stop)
        self._refusing(self._fmu.finish)

    def outputs_before(self, values: Mapping[str, Value]) -> list[float]:
        self._refusing(self._fmu.begin, values)
        shown: list[float] = []
        self._refusing(lambda: shown.extend(self.outputs()))
        return shown

    def set(self, name: str, value: Value) -> None:
        self._refusing(self._fmu.set, name, value)

    def set_slope(self, name: str, slope: float) -> None:
        reference = self._fmu.variables[name].valueReference
        self._refusing(self._fmu._call, self._fmu.slave.setRealInputDerivatives, [reference], [1], [slope])

    def step(self, t: float, h: float) -> None:
        self._refusing(self._fmu.step, t, h)

    def outputs(self) -> list[float]:
        return [float(value) for value in self._read()]

    def window(self, name: str) -> Array:
        names = [variable for variable in self._fmu.variables if variable.partition("[")[0] == name]
        return np.array(self._fmu.reader(names)())

    def save(self) -> bytes:
        return self._fmu.save()

    def restore(self, blob: bytes) -> None:
        self._refusing(self._fmu.restore, blob)

    def reset(self) -> None:
        self._fmu.reset()

    def warnings(self) -> list[str]:
        return [message for status, message in self._fmu.log if status == 1]

    def close(self) -> None:
        self._fmu.close()

    @staticmethod
    def _refusing(function: Callable[..., Any], *arguments: Any, **keywords: Any) -> None:
        try:
            function(*arguments, **keywords)
        except FmuError as error:
            raise RefusedStreamError(str(error)) from error
