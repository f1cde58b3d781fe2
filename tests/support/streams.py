"""Streams of every implementation for tests: a behavioural test that takes one runs on all of them."""

import shutil
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built_once import BuiltFmus
from c_core import CModel, RefusedError, write_trajectory
from driving import initialise
from library_stream import LookAheadStream, PlantStream, learned_file
from stream import (
    CANNOT,
    CORE,
    FMI3,
    IMPLEMENTATIONS,
    LIBRARY,
    NATIVE,
    OUTPUTS,
    STAGE,
    STAGE_COMPENSATOR,
    STAGE_PREDICTOR,
    TRAJECTORY,
    Array,
    RefusedStreamError,
    Stream,
    Value,
    kind_of,
    machine_of,
)

from hybridsep.base.errors import FmuError
from hybridsep.base.state import pack, unpack
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.weights import WEIGHTS_FILE
from hybridsep.plants.trajectory import staircase

STAGES = (STAGE, STAGE_PREDICTOR, STAGE_COMPENSATOR)
"""Models of the stage's X drive, which differ from the default machine's in modes and settings."""


def _refusing(kind: type[Exception], function: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
    """Call a function whose refusal is an error of its own; return what it does."""
    try:
        return function(*arguments, **keywords)
    except kind as error:
        raise RefusedStreamError(str(error)) from error


class CoreStream:
    """The C core through ctypes, as an adapter holds it: the block of its state beside the values.

    ``resources``: folder of the files that the model reads; ``learned``: content of ``weights.bin``, with which no
    warm-up is needed.
    """

    def __init__(self, model: str, resources: Path, learned: bytes | None = None) -> None:
        self.model = model
        self._kind = f"core {model}"
        self._start = {"t_init": 0.0} if learned else {}
        self._resources, self._learned = resources, learned or None
        self.reset()
        self._outputs = OUTPUTS[kind_of(model)]
        self._warnings: list[str] = []

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._take(values)
        _refusing(RefusedError, self._core.initialise, start)
        self._keep_warning()

    def outputs_before(self, values: Mapping[str, Value]) -> list[float]:
        self._take(values)
        _refusing(RefusedError, self._core.start_values)
        return self.outputs()

    def set(self, name: str, value: Value) -> None:
        self._core[name] = float(value)

    def set_slope(self, name: str, slope: float) -> None:
        self._core.values[self._core.slope_place[name]] = slope

    def step(self, t: float, h: float) -> None:
        _refusing(RefusedError, self._core.step, t, h)
        self._keep_warning()

    def outputs(self) -> list[float]:
        return [self._core[name] for name in self._outputs]

    def window(self, name: str) -> Array:
        return self._core.window(name)

    def save(self) -> bytes:
        return pack(self._kind, {}, {"state": self._core.state.view(np.float64), "values": self._core.values})

    def restore(self, blob: bytes) -> None:
        _, arrays, _ = unpack(self._kind, blob)
        self._core.values, self._core.state = arrays["values"].copy(), arrays["state"].copy()

    def reset(self) -> None:
        self._core = CModel(self.model, self._start, self._resources, self._learned)

    def warnings(self) -> list[str]:
        return self._warnings

    def close(self) -> None:
        pass

    def _keep_warning(self) -> None:
        if self._core.warning:
            self._warnings.append(self._core.warning)

    def _take(self, values: Mapping[str, Value]) -> None:
        for name, value in values.items():
            self._core[name] = float(value)


class FmuStream:
    """An FMU through fmpy."""

    def __init__(self, archive: Path, model: str) -> None:
        self.model = model
        self._outputs = OUTPUTS[kind_of(model)]
        self._fmu = FmuInstance(archive)
        # Of each type in one call: one by one they would take as long as the steps between
        self._read = self._fmu.reader(self._outputs)

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        _refusing(FmuError, self._fmu.begin, values, start_time=start, stop_time=stop)
        _refusing(FmuError, self._fmu.finish)

    def outputs_before(self, values: Mapping[str, Value]) -> list[float]:
        _refusing(FmuError, self._fmu.begin, values)
        return list(_refusing(FmuError, self.outputs))

    def set(self, name: str, value: Value) -> None:
        _refusing(FmuError, self._fmu.set, name, value)

    def set_slope(self, name: str, slope: float) -> None:
        reference = self._fmu.variables[name].valueReference
        _refusing(FmuError, self._fmu._call, self._fmu.slave.setRealInputDerivatives, [reference], [1], [slope])

    def step(self, t: float, h: float) -> None:
        _refusing(FmuError, self._fmu.step, t, h)

    def outputs(self) -> list[float]:
        return [float(value) for value in self._read()]

    def window(self, name: str) -> Array:
        names = [variable for variable in self._fmu.variables if variable.partition("[")[0] == name]
        return np.array(self._fmu.reader(names)())

    def save(self) -> bytes:
        return self._fmu.save()

    def restore(self, blob: bytes) -> None:
        _refusing(FmuError, self._fmu.restore, blob)

    def reset(self) -> None:
        self._fmu.reset()

    def warnings(self) -> list[str]:
        return [message for status, message in self._fmu.log if status == 1]

    def close(self) -> None:
        self._fmu.close()


class StreamMaker:
    """Make streams of one model in one implementation; all that were made are closed together.

    ``fmus``: where archives come from; ``folder``: for the files that the C core reads.
    """

    def __init__(self, implementation: str, model: str, fmus: BuiltFmus, folder: Path) -> None:
        self.implementation, self.model = implementation, model
        self.fmus, self.folder = fmus, folder
        self._made: list[Stream] = []

    def __call__(self, model: str | None = None, *, weights: Path | None = None) -> Stream:
        """Return a new stream, of another model if one is given, that starts warm with a saved predictor."""
        self._made.append(self._new(model or self.model, weights))
        return self._made[-1]

    def begun(self, start: float = 0.0, **values: Value) -> Stream:
        """Return a new stream that is initialised, a look-ahead with short windows."""
        stream = self()
        initialise(stream, start, **values)
        return stream

    def planted(self, learned: bytes) -> Stream:
        """Return a new stream whose resources have this ``weights.bin``, which no build would have let in."""
        self._made.append(self._new(self.model, None, learned))
        return self._made[-1]

    def close(self) -> None:
        for stream in self._made:
            stream.close()

    def _new(self, model: str, weights: Path | None, planted: bytes = b"") -> Stream:
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        if self.implementation not in (LIBRARY, CORE):
            archive = self.fmus(fmu_name(model, self.implementation), machine=machine_of(model), weights=weights)
            if planted:
                archive = Path(shutil.copy(archive, folder))
                with zipfile.ZipFile(archive, "a") as content:
                    content.writestr(f"resources/{WEIGHTS_FILE}", planted)
            return FmuStream(archive, model)
        learned = planted or learned_file(weights)
        if self.implementation == LIBRARY:
            return PlantStream(model) if "FeedDrive" in model else LookAheadStream(model, learned)
        if model == TRAJECTORY:
            write_trajectory(folder, staircase())
        return CoreStream(model, folder, learned)


_SUFFIX = {NATIVE: "", FMI3: "Fmi3"}


def fmu_name(model: str, implementation: str) -> str:
    """Return the archive's stem, whose flavour follows the model: ``FeedDrivePy_als25010_x``."""
    kind, separator, machine = model.partition("_")
    return f"{kind}{_SUFFIX[implementation]}{separator}{machine}"


def cases(models: Sequence[str], *, needs: str = "", adapters: bool = False, alike: Sequence[str] = ()) -> list[Any]:
    """Return pytest parameters ``(implementation, model)`` for all that there are, and that can do what is needed.

    With ``adapters`` the FMI 3.0 FMU of the first model is among them. What a native FMU computes is the C core's: it
    runs one set of a test's other parameters, but for a test of adapters, and so does what ``alike`` names
    (``one_set``); the other sets run at night.
    """
    once = alike if adapters and needs != "agreement" else (NATIVE, *alike)
    pairs = [(implementation, model) for implementation in IMPLEMENTATIONS for model in models]
    if adapters:
        pairs.append((FMI3, models[0]))
    return [
        pytest.param(
            (implementation, model),
            id=f"{implementation}-{model}",
            marks=[
                *([pytest.mark.one_set] if implementation in once else []),
                *([pytest.mark.slow] if model in STAGES else []),
            ],
        )
        for implementation, model in pairs
        if not {(implementation, model), (implementation, needs)} & CANNOT.keys()
    ]


def on_all(models: Sequence[str], *, needs: str = "", alike: Sequence[str] = ()) -> pytest.MarkDecorator:
    """Return the mark of a test that takes ``new_stream``, on all implementations."""
    return pytest.mark.parametrize("new_stream", cases(models, needs=needs, alike=alike), indirect=True)


def on_adapters(models: Sequence[str], *, needs: str = "") -> pytest.MarkDecorator:
    """Return the same mark for a test of what an adapter does: the FMI 3.0 FMU of the first model takes part."""
    return pytest.mark.parametrize("new_stream", cases(models, needs=needs, adapters=True), indirect=True)
