"""Build the C core with the host's compiler and drive it through ctypes."""

import ctypes
import hashlib
import struct
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built_once import built_once, shared_builds
from c_compiler import C_SOURCES, build_folder, include_flags, run_compiler
from places import ROOT
from stream import table_of_model

from hybridsep.base.signals import Array
from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.variables import INTERPOLATED, FmuTable

TS = 1e-3  # s

MESSAGE_SIZE = 512

TABLES: dict[str, FmuTable] = {}
"""Tables of models that are no machine's FMU, by name."""


def table_of(name: str) -> FmuTable:
    """Return one of :data:`TABLES`, or that of an FMU of this name."""
    return TABLES.get(name) or table_of_model(name)


def sources() -> list[str]:
    """Return every C file of core and models."""
    return sorted(str(path) for folder in ("core", "model") for path in (C_SOURCES / folder).rglob("*.c"))


def model_sources() -> list[str]:
    """Return the C files that depend on an FMU's header."""
    return [source for source in sources() if Path(source).name.startswith("model_")]


@cache
def object_files(flags: tuple[str, ...] = ("-O1", "-fPIC"), command: tuple[str, ...] = ()) -> list[str]:
    """Compile all other C files, once for each set of options, with the host's compiler if no other is asked for."""
    # All processes of a session share them. -O2 takes twice as long, for tests that compute for little of their time
    key = hashlib.sha256(repr((flags, command)).encode()).hexdigest()[:16]
    compiled = sorted(set(sources()) - set(model_sources()))

    def build(folder: Path) -> None:
        folder.mkdir()

        def compile_one(source: str) -> None:
            target = folder / f"{Path(source).stem}.o"
            run_compiler([*flags, *include_flags(), "-c", source, "-o", target], command=command)

        with ThreadPoolExecutor() as pool:  # other processes may wait for them
            list(pool.map(compile_one, compiled))

    folder = built_once(shared_builds() / f"objects_{key}", build)
    return [str(folder / f"{Path(source).stem}.o") for source in compiled]


def write_header(name: str, folder: Path) -> None:
    """Write a model's hsep_fmu.h."""
    folder.mkdir(exist_ok=True)
    (folder / "hsep_fmu.h").write_text(c_header(table_of(name), "{test}"), encoding="utf-8")


class Context(ctypes.Structure):
    """hsep_context."""

    _fields_ = (
        ("variables", ctypes.c_void_p),
        *((name, ctypes.c_size_t) for name in ("n_scalars", "n_modes", "n_last", "window", "n_variables")),
        ("starts", ctypes.c_void_p),
        ("guid", ctypes.c_char_p),
        ("angular", ctypes.c_int),
        ("resources", ctypes.c_char_p),
        ("weights", ctypes.c_char_p),
        ("weights_size", ctypes.c_size_t),
    )


@cache
def library(name: str) -> ctypes.CDLL:
    """Return the shared library of a model, built when first asked for, once a session."""
    folder = build_folder() / name
    write_header(name, folder)
    key = hashlib.sha256((folder / "hsep_fmu.h").read_bytes()).hexdigest()[:16]
    flags = ["-O0", "-fPIC", "-shared", f"-I{folder}", *include_flags()]

    def build(built: Path) -> None:
        run_compiler([*flags, *model_sources(), ROOT / "tests" / "c" / "expose.c", *object_files(), "-lm", "-o", built])

    loaded = ctypes.CDLL(str(built_once(shared_builds() / f"{name}_{key}.so", build)))
    loaded.test_table.restype = ctypes.POINTER(Context)
    loaded.hsep_regression_size.restype = ctypes.c_double
    loaded.hsep_encoder_measure.restype = ctypes.c_double
    loaded.hsep_regression_row.restype = ctypes.POINTER(ctypes.c_double)
    return loaded


class RefusedError(Exception):
    """A call returned HSEP_REFUSED; the text is its message."""


class CModel:
    """One instance of a model, as an adapter holds it.

    ``name``: of its FMU, or of :data:`TABLES`; ``start``: values that differ from its start values; ``resources``:
    resources folder; ``weights``: content of ``weights.bin``, with which it starts.
    """

    def __init__(
        self,
        name: str,
        start: Mapping[str, float] | None = None,
        resources: Path | None = None,
        weights: bytes | None = None,
    ) -> None:
        self.library = library(name)
        model, table = table_of(name).model, table_of(name).variables
        self.place = {variable.name: i for i, variable in enumerate(table)}
        slopes = INTERPOLATED[model]
        self.slope_place = {slope: len(table) + self.place[slope] for slope in slopes}
        self.values: Array = np.array([float(variable.start or 0.0) for variable in table] + [0.0] * len(slopes))
        self.context = Context.from_buffer_copy(self.library.test_table().contents)
        self.context.resources = f"{resources}/".encode() if resources else None
        self.learn(weights)
        for key, value in (start or {}).items():
            self[key] = value
        self.state: Array = np.zeros(0)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.place[name]])

    def __setitem__(self, name: str, value: float) -> None:
        self.values[self.place[name]] = value

    def learn(self, weights: bytes | None) -> None:
        """Take the content of ``weights.bin`` that the next initialization starts with, none for a cold one."""
        self.context.weights, self.context.weights_size = weights, len(weights or b"")

    def size(self) -> int:
        """Return the bytes of the state."""
        size = ctypes.c_size_t()
        self._call("size", self._values, ctypes.byref(size))
        return size.value

    def start_values(self) -> None:
        """Write outputs and locals as they are before the initialization ends, if the command starts at a position."""
        self._call("check_start", self._values)
        self.library.hsep_model_start_values(ctypes.byref(self.context), self._values)

    def initialise(self, t_start: float = 0.0, *, size: int | None = None) -> "CModel":
        """Make the state, of the size that the model tells if no other is given."""
        size = self.size() if size is None else size
        self.state = np.zeros(-(-size // 8))
        self._call("initialise", self._state, ctypes.c_size_t(size), self._values, ctypes.c_double(t_start))
        return self

    def step(self, t: float, h: float = 1e-3) -> None:
        """Do one communication step, after which the adapter's time derivatives are 0."""
        self._call("step", self._state, self._values, ctypes.c_double(t), ctypes.c_double(h))
        self.values[list(self.slope_place.values())] = 0.0

    def window(self, name: str) -> Array:
        """Return a window variable's samples, as an adapter shows them."""
        if len(self.state):
            self.library.hsep_model_show_windows(ctypes.byref(self.context), self._state, self._values)
        first = self.place[f"{name}[1]"]
        n = sum(key.startswith(f"{name}[") for key in self.place)
        samples: Array = self.values[first : first + n].copy()
        return samples

    @property
    def _values(self) -> Any:
        return self.values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    @property
    def _state(self) -> Any:
        return pointer(self.state)

    def _call(self, function: str, *arguments: Any) -> None:
        message = ctypes.create_string_buffer(b"\0" * MESSAGE_SIZE + b"unwritten")
        status = getattr(self.library, f"hsep_model_{function}")(ctypes.byref(self.context), *arguments, message)
        assert message.raw[MESSAGE_SIZE:] == b"unwritten\0"
        if status == 1:
            raise RefusedError(message.value.decode("utf-8"))
        self.warning = message.value.decode("utf-8") if status else ""


def pointer(array: Array) -> Any:
    """Return the address of an array's numbers, for a call into the library."""
    return array.ctypes.data_as(ctypes.c_void_p)


def write_trajectory(folder: Path, samples: Array, T_s: float = TS) -> None:
    """Write ``trajectory_0.bin`` into a resources folder."""
    head = b"HSEPTRJ1" + struct.pack("<Qd", len(samples), T_s)
    (folder / "trajectory_0.bin").write_bytes(head + samples.astype("<f8").tobytes())


def refusal(action: Callable[[], Any]) -> str:
    """Return the message with which something is refused."""
    with pytest.raises(RefusedError) as caught:
        action()
    return str(caught.value)
