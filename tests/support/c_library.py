"""The C core as an installed CMake package, and its interface (hsep.h) through ctypes."""

import ctypes
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from built_once import built_once, shared_builds
from c_compiler import C_SOURCES
from c_core import library as core_library
from programs import output_of
from stream import STAGE_COMPENSATOR

from hybridsep.base.parameters import Parameter
from hybridsep.fmi.variables import AVERAGING_SETTINGS, COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS

STRICT = "-Wall -Wextra -Wconversion -pedantic -Werror"


def cmake(*arguments: str | Path) -> str:
    """Run the package's cmake, a dependency of the tests, on Ninja; return what it printed."""
    environment = os.environ | {"PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    return output_of(sys.executable, "-m", "cmake", *arguments, env=environment)


def configured(source: Path, folder: Path, *definitions: str) -> None:
    """Configure and build a project."""
    cmake("-G", "Ninja", "-S", source, "-B", folder, *(f"-D{one}" for one in definitions))
    cmake("--build", folder)


def installed() -> Path:
    """Return the prefix of the installed package; its build folder, with the examples, is ``build`` in it."""

    def build(prefix: Path) -> None:
        flags = f"CMAKE_C_FLAGS={STRICT}"
        # unoptimised: what is tested is how it is built, and what it returns
        configured(
            C_SOURCES, prefix / "build", flags, "CMAKE_BUILD_TYPE=Debug", "CMAKE_C_FLAGS_DEBUG=-O0", "HSEP_EXAMPLES=ON"
        )
        cmake("--install", prefix / "build", "--prefix", prefix)

    return built_once(shared_builds() / "hsep_package", build)


class Mode(ctypes.Structure):
    """hsep_mode."""

    _fields_ = tuple((name, ctypes.c_double) for name in ("f_n", "zeta", "alpha", "beta"))


def _part(settings: Mapping[str, Parameter]) -> type[ctypes.Structure]:
    """Return the struct of a part's settings, as hsep_predictor_settings is one."""
    kinds = {name: ctypes.c_double if one.kind is float else ctypes.c_uint64 for name, one in settings.items()}
    return type("Part", (ctypes.Structure,), {"_fields_": tuple(kinds.items())})


_SETTINGS = {"predictor": PREDICTOR_SETTINGS, "averaging": AVERAGING_SETTINGS, "compensator": COMPENSATOR_SETTINGS}
PARTS = {name: _part(settings) for name, settings in _SETTINGS.items()}
"""Structs of settings, by their names in hsep_parameters."""


class Parameters(ctypes.Structure):
    """hsep_parameters."""

    _fields_ = (*PARTS.items(), ("n_modes", ctypes.c_uint64), ("modes", ctypes.POINTER(Mode)))

    def __setitem__(self, name: str, value: float) -> None:
        """Set a setting, whichever part has it."""
        part = next(part for part, settings in _SETTINGS.items() if name in settings)
        setattr(getattr(self, part), name, value)


class PredictorOutputs(ctypes.Structure):
    """hsep_predictor_outputs."""

    _reals = ("x_d", "x_pb", "x_h", "x_h_std", "rms_e", "rms_pb", "rms_h", "rms_hold")
    _fields_ = (
        *((name, ctypes.c_double) for name in _reals),
        *((name, ctypes.c_uint64) for name in ("batch", "n_rejected")),
        *((name, ctypes.c_int) for name in ("hybrid_active", "divergence")),
    )


class CompensatorOutputs(ctypes.Structure):
    """hsep_compensator_outputs."""

    _fields_ = (
        ("predicted", PredictorOutputs),
        ("x_dm", ctypes.c_double),
        ("state", ctypes.c_int),
        ("no_measurement", ctypes.c_int),
        ("alarm", ctypes.c_int),
    )


@cache
def interface() -> ctypes.CDLL:
    """Return the core's functions, from a shared library that other tests need as well."""
    loaded = core_library(STAGE_COMPENSATOR)
    for kind in ("predictor", "compensator"):
        for function in ("size", "weights"):
            getattr(loaded, f"hsep_{kind}_{function}").restype = ctypes.c_size_t
        getattr(loaded, f"hsep_{kind}_refused").restype = ctypes.c_char_p
    return loaded


class Library:
    """A ``kind`` of the C library, "predictor" or "compensator"; ``settings``: those that differ from the defaults."""

    def __init__(self, kind: str, settings: Mapping[str, float], modes: Sequence[Mapping[str, float]]) -> None:
        self.kind, self.core = kind, interface()
        self.modes = (Mode * len(modes))(*(Mode(**mode) for mode in modes))
        self.parameters = Parameters()
        self.core.hsep_defaults(ctypes.byref(self.parameters))
        self.parameters.n_modes = len(modes)
        self.parameters.modes = self.modes
        for name, value in settings.items():
            self.parameters[name] = value
        self.outputs = CompensatorOutputs()
        self.block: Any = None

    def size(self) -> int:
        """Return the bytes of the block; 0: refused."""
        return int(self._call("size", ctypes.byref(self.parameters)))

    def refused(self) -> str:
        """Return the name of the first parameter that is refused; empty if none is."""
        name: bytes | None = self._call("refused", ctypes.byref(self.parameters))
        assert (name is None) == (self.size() > 0)
        return (name or b"").decode()

    def begin(self, start: float, weights: bytes | None = None) -> int:
        """Begin; return hsep_began."""
        self.block = (ctypes.c_double * (self.size() // 8))()
        size = ctypes.c_size_t(len(weights or b""))
        return int(self._call("init", self.block, ctypes.byref(self.parameters), ctypes.c_double(start), weights, size))

    def weights(self, room: int = sys.maxsize) -> bytes:
        """Return what was learned so far, as a weights file; empty if there is less room for it, bytes."""
        needed = int(self._call("weights", self.block, ctypes.byref(self.parameters), None, ctypes.c_size_t(0)))
        content = (ctypes.c_double * (needed // 8))()
        given = ctypes.c_size_t(min(room, needed))
        assert self._call("weights", self.block, ctypes.byref(self.parameters), content, given) == needed
        return bytes(content) if any(bytes(content)) else b""

    def load(self, x_load: float) -> None:
        """Set the load that a compensator's samples bring from now on, m."""
        self._call("load", self.block, ctypes.c_double(x_load))

    def sample(self, x_d_ahead: float, x_meas: float) -> CompensatorOutputs:
        """Process a sample and return the outputs of the next one; of a predictor in ``predicted``."""
        self._call("sample", self.block, ctypes.c_double(x_d_ahead), ctypes.c_double(x_meas))
        outputs = self.outputs.predicted if self.kind == "predictor" else self.outputs
        self._call("read", self.block, ctypes.byref(outputs))
        return self.outputs

    def _call(self, function: str, *arguments: Any) -> Any:
        return getattr(self.core, f"hsep_{self.kind}_{function}")(*arguments)
