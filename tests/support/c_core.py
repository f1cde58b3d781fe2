"""Build the C core with the host's compiler and drive it through ctypes."""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray
from places import ROOT

from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.variables import INTERPOLATED, variables_of
from hybridsep.machine import load_machine

Array = NDArray[np.float64]

TS = 1e-3  # s

C_SOURCES = ROOT / "fmu_src" / "c"
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
"""fmpy's, for shared libraries: the names of the FMI functions are the plain ones."""

EXPOSE = ROOT / "tests" / "c" / "expose.c"
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wcast-qual", "-pedantic", "-Werror", "-ffp-contract=off"]
MESSAGE_SIZE = 512

SPRING_MASS_DAMPER = {"f_n": np.sqrt(24674.0) / (2 * np.pi), "zeta": 15.7 / (2 * np.sqrt(24674.0))} | {
    "alpha": 24674.0,
    "beta": 15.7,
}
"""The staircase drive's linear part, as one mode of eq. (15)."""

STAGE_MODES = [asdict(mode) for mode in load_machine("als25010_x").model.modes]
"""The stage's X axis, Table 1."""
PREDICTOR = {"Np": 100, "p": 50, "q": 3, "lambda": 1e-12, "T_s": 1e-3, "t_init": 0.3, "input_hold": 0, "dead_time": 0}
FEED_DRIVE = {"m": 1.0, "c": 15.7, "k": 24674.0, "c_nl": 100.0, "k_nl": 1000.0, "noise_std": 5e-6, "seed": 0}
STAGE_DRIVE = {"f": 1.4211e-5, "kappa": 0.0213165, "T_s": 1e-3, "noise_std": 1e-6, "seed": 7}

COMPENSATOR = {
    **PREDICTOR,
    "preview": 200,
    "spacing": 2,
    "jerk_weight": 1.0,
    "v_max": 0.1,
    "a_max": 16.0,
    "j_max": 5000.0,
    "change_max": 1e-3,
    "v_friction": 2e-3,
    "no_reversal": 1,
    "compensate": 2,
}

DESCRIPTIONS: dict[str, dict[str, Any]] = {
    "predictor": {"model": "HybridPredictor", "parameters": PREDICTOR, "modes": [SPRING_MASS_DAMPER]},
    "predictor_2": {"model": "HybridPredictor", "parameters": PREDICTOR, "modes": STAGE_MODES},
    "feed_drive": {"model": "FeedDrive", "parameters": FEED_DRIVE, "modes": []},
    "stage_drive": {"model": "FeedDrive", "parameters": STAGE_DRIVE, "modes": STAGE_MODES},
    "compensator": {"model": "SepCompensator", "parameters": COMPENSATOR, "modes": [SPRING_MASS_DAMPER]},
    "compensator_2": {"model": "SepCompensator", "parameters": COMPENSATOR, "modes": STAGE_MODES},
    "trajectory": {"model": "ReferenceTrajectory", "parameters": {"trajectory": 3, "T_s": 1e-3}, "modes": []},
}
"""Models built here, described as in an FMU's machine.json."""


def compiler() -> list[str]:
    """Return the command of a C compiler, or say that there is none."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return [path]
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    raise RuntimeError("the C core needs a C compiler: set CC, or install cc, gcc, clang or the ziglang package")


@cache
def sanitising_compiler() -> list[str]:
    """Return the command of a C compiler that brings the address sanitizer as a library of its own; empty if none."""
    for command in (compiler(), ["gcc"], ["cc"]):
        if shutil.which(command[0]) and address_sanitizer(command) and _catches_overflows(command):
            return command
    return []


def _catches_overflows(command: Sequence[str]) -> bool:
    """Return whether a compiler's address sanitizer sees a write behind a block; a library found may not be its own."""
    source, program = build_folder() / "overflow.c", build_folder() / "overflow"
    source.write_text(
        "#include <stdlib.h>\nint main(int n, char **a) { char *b = malloc(8); b[7 + n] = **a; free(b); }\n"
    )
    built = subprocess.run([*command, "-fsanitize=address", source, "-o", program], capture_output=True, check=False)
    if built.returncode:
        return False
    done = subprocess.run([program], capture_output=True, check=False)
    return done.returncode != 0 and b"AddressSanitizer" in done.stderr


def address_sanitizer(command: Sequence[str]) -> str:
    """Return the path of a compiler's libasan; empty if it has none."""
    asked = subprocess.run([*command, "-print-file-name=libasan.so"], capture_output=True, text=True, check=False)
    path = asked.stdout.strip()
    return path if Path(path).is_absolute() and Path(path).exists() else ""


def sources() -> list[str]:
    """Return every C file of core and models."""
    return sorted(str(path) for folder in ("core", "model") for path in (C_SOURCES / folder).rglob("*.c"))


def run_compiler(arguments: Sequence[str | Path], *, command: Sequence[str] = ()) -> None:
    """Compile, with the host's compiler if no other is asked for, or raise with what it said."""
    done = subprocess.run(
        [*(command or compiler()), *FLAGS, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=build_folder(),
    )
    if done.returncode:
        raise RuntimeError(f"the C compiler failed:\n{done.stderr}")


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="hsep_c_core_")


def build_folder() -> Path:
    """Return this process's folder for what is built; it goes when the process ends."""
    return Path(_temporary().name)


needs_sanitisers = pytest.mark.skipif(
    not sanitising_compiler(), reason="no C compiler here brings the address sanitizer; install gcc with libasan"
)


@cache
def object_files() -> list[str]:
    """Compile what does not depend on an FMU's header, once."""
    folder = build_folder() / "common"
    folder.mkdir()
    objects = []
    for source in sources():
        if not Path(source).name.startswith("model_"):
            objects.append(str(folder / f"{Path(source).stem}.o"))
            run_compiler(["-O2", "-fPIC", *include_flags(), "-c", source, "-o", objects[-1]])
    return objects


def include_flags() -> list[str]:
    """Return the options with which a file finds every header by its name."""
    return [f"-I{folder}" for folder in sorted({path.parent for path in C_SOURCES.rglob("*.h")})]


def write_header(name: str, folder: Path) -> None:
    """Write hsep_fmu.h of one of :data:`DESCRIPTIONS`."""
    folder.mkdir(exist_ok=True)
    (folder / "hsep_fmu.h").write_text(c_header({"name": name, **DESCRIPTIONS[name]}, "{test}"), encoding="utf-8")


@cache
def library(name: str) -> ctypes.CDLL:
    """Return the shared library of one of :data:`DESCRIPTIONS`, built when first asked for."""
    folder = build_folder() / name
    write_header(name, folder)
    models = [source for source in sources() if Path(source).name.startswith("model_")]
    built = folder / "model.so"
    run_compiler(
        [
            "-O2",
            "-fPIC",
            "-shared",
            f"-I{folder}",
            *include_flags(),
            *models,
            EXPOSE,
            *object_files(),
            "-lm",
            "-o",
            built,
        ]
    )
    loaded = ctypes.CDLL(str(built))
    loaded.test_variables.restype = ctypes.c_void_p
    for function in ("physics", "regression", "predictor"):
        getattr(loaded, f"hsep_{function}_size").restype = ctypes.c_double
    loaded.hsep_encoder_measure.restype = ctypes.c_double
    loaded.hsep_regression_row.restype = ctypes.POINTER(ctypes.c_double)
    return loaded


class Context(ctypes.Structure):
    """hsep_context."""

    _fields_ = (("variables", ctypes.c_void_p), ("n_variables", ctypes.c_size_t), ("resources", ctypes.c_char_p))


class RefusedError(Exception):
    """A call returned HSEP_REFUSED; the text is its message."""


class CModel:
    """One instance of a model, as an adapter holds it.

    Parameters
    ----------
    name : str
        Of :data:`DESCRIPTIONS`.
    start : mapping
        Values that differ from the table's start values.
    resources : Path, optional
        Resources folder.
    """

    def __init__(self, name: str, start: Mapping[str, float] | None = None, resources: Path | None = None) -> None:
        self.library = library(name)
        table = variables_of(DESCRIPTIONS[name])
        self.place = {variable.name: i for i, variable in enumerate(table)}
        slopes = INTERPOLATED[DESCRIPTIONS[name]["model"]]
        self.slope_place = {slope: len(table) + self.place[slope] for slope in slopes}
        self.values: Array = np.array([float(variable.start or 0.0) for variable in table] + [0.0] * len(slopes))
        self.context = Context(
            self.library.test_variables(), len(table), f"{resources}/".encode() if resources else None
        )
        for key, value in (start or {}).items():
            self[key] = value
        self.state: Array = np.zeros(0)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.place[name]])

    def __setitem__(self, name: str, value: float) -> None:
        self.values[self.place[name]] = value

    def size(self) -> int:
        """Return the bytes of the state."""
        size = ctypes.c_size_t()
        self._call("size", self._values, ctypes.byref(size))
        return size.value

    def start_values(self) -> None:
        """Write outputs and locals as they are before the initialization ends."""
        self.library.hsep_model_start_values(ctypes.byref(self.context), self._values)

    def initialise(self, t_start: float = 0.0, *, size: int | None = None) -> CModel:
        """Make the state, of the size that the model tells if no other is given."""
        size = self.size() if size is None else size
        self.state = np.zeros(-(-size // 8))
        self._call("initialise", self._state, ctypes.c_size_t(size), self._values, ctypes.c_double(t_start))
        return self

    def step(self, t: float, h: float = 1e-3) -> None:
        """Do one communication step, after which the adapter's time derivatives are 0."""
        self._call("step", self._state, self._values, ctypes.c_double(t), ctypes.c_double(h))
        self.values[list(self.slope_place.values())] = 0.0

    def check_state(self, blob: bytes) -> None:
        """Check that a blob is a state of this instance."""
        self._call("check_state", ctypes.c_char_p(blob), ctypes.c_size_t(len(blob)), self._values)

    def window(self, name: str) -> Array:
        """Return a window variable's samples."""
        first = self.place[f"{name}[1]"]
        n = sum(key.startswith(f"{name}[") for key in self.place)
        samples: Array = self.values[first : first + n].copy()
        return samples

    @property
    def _values(self) -> Any:
        return self.values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    @property
    def _state(self) -> Any:
        return self.state.ctypes.data_as(ctypes.c_void_p)

    def _call(self, function: str, *arguments: Any) -> None:
        message = ctypes.create_string_buffer(b"\xff" * MESSAGE_SIZE + b"unwritten")
        status = getattr(self.library, f"hsep_model_{function}")(ctypes.byref(self.context), *arguments, message)
        assert message.raw[MESSAGE_SIZE:] == b"unwritten\0"
        if status == 1:
            raise RefusedError(message.value.decode("utf-8"))
        self.warning = message.value.decode("utf-8") if status else ""


def write_weights(folder: Path, name: str, factor: Array, n_samples: int, **settings: float) -> None:
    """Write ``weights.bin``, as the C model describes it, into a resources folder; ``settings`` replace the table's."""
    values = {"v_friction": 0.0, **DESCRIPTIONS[name]["parameters"], **settings}
    modes = DESCRIPTIONS[name]["modes"]
    names = ("p", "q", "lambda", "T_s", "input_hold", "v_friction", "dead_time")
    learned = {key: values[key] for key in names}
    learned |= {f"mode[{i}].{key}": value for i, mode in enumerate(modes, start=1) for key, value in mode.items()}
    content = b"HSEPWGT3" + struct.pack("<3Q", len(learned), len(modes), n_samples)
    content += b"".join(struct.pack("<24sd", key.encode(), value) for key, value in learned.items())
    content += np.concatenate([factor[i, i:] for i in range(len(factor))]).astype("<f8").tobytes()
    (folder / "weights.bin").write_bytes(content + struct.pack("<Q", zlib.crc32(content)))


def write_trajectory(folder: Path, samples: Array, T_s: float = TS) -> None:
    """Write ``trajectory_3.bin`` into a resources folder."""
    head = b"HSEPTRJ1" + struct.pack("<Qd", len(samples), T_s)
    (folder / "trajectory_3.bin").write_bytes(head + samples.astype("<f8").tobytes())


def refusal(action: Callable[[], Any]) -> str:
    """Return the message with which something is refused."""
    with pytest.raises(RefusedError) as caught:
        action()
    return str(caught.value)
