"""C core with some of its sources changed, compiled for this machine, and replays by it.

It predicts as the library does, to rounding, some fifty times faster: a change to the model is tried in seconds. A last
window that is cut off is predicted as part of a whole one, and not learned.
"""

import ctypes
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from c_library import PARTS as SETTINGS
from c_library import Mode, Parameters

from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

SOURCES = Path(__file__).resolve().parents[2] / "fmu_src" / "c" / "core"

PARTS = ("numeric", "modal", "predict", "online")  # folders of the core that a predictor needs

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Dmemcpy=memmove")
"""Options of the compiler; a change may make what is copied overlap."""

Run = tuple[Array, Array]  # commanded and measured positions, ``(n,)`` each, m

Changes = Mapping[str, Sequence[tuple[str, str]]]
"""Path of a file below ``fmu_src/c/core`` → pairs of a text in it, and what replaces it."""

_DOUBLES = ctypes.POINTER(ctypes.c_double)


class _Run(ctypes.Structure):
    _fields_ = (("n", ctypes.c_uint64), *((name, _DOUBLES) for name in ("x_d", "x", "x_h", "std")))


class CoreVariant:
    """C core with changes."""

    def __init__(self, changes: Changes) -> None:
        self.changes = changes

    def __reduce__(self) -> "tuple[type[CoreVariant], tuple[Changes]]":
        return CoreVariant, (self.changes,)  # each process builds its own

    @cached_property
    def _library(self) -> ctypes.CDLL:
        with TemporaryDirectory() as name:
            folder = Path(name)
            for part in PARTS:
                shutil.copytree(SOURCES / part, folder / part)
            for path, pairs in self.changes.items():
                file = folder / path
                text = file.read_text(encoding="utf-8")
                for old, new in pairs:
                    if old not in text:
                        raise ValueError(f"{path} has no {old!r}")
                    text = text.replace(old, new)
                file.unlink()
                file.write_text(text, encoding="utf-8")
            headers = {f"-I{path.parent}" for path in folder.rglob("*.h")} | {
                f"-I{SOURCES.parent}",
                f"-I{SOURCES / 'library'}",
            }
            sources = [path for path in folder.rglob("*.c") if path.stem != "hsep_clock"]
            harness, built = Path(__file__).with_suffix(".c"), folder / "variant.so"
            subprocess.run(["cc", *FLAGS, *sorted(headers), harness, *sources, "-lm", "-o", built], check=True)
            return ctypes.CDLL(str(built))

    def replay(
        self, model: ModalModel, settings: PredictorSettings, first: Run, second: Run
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return predictions and their standard deviations, ``(n,)`` each, m, of a cold run and of a warm one after it.

        The warm one may be empty.

        Raises
        ------
        SignalError
            If a prediction diverges.
        """
        fmi = {**settings.to_fmi(), "dead_time": model.dead_time, "averaging": 1}
        modes = (Mode * len(model.modes))(*(Mode(one.f_n, one.zeta, one.alpha, one.beta) for one in model.modes))
        parameters = Parameters(*(_filled(SETTINGS[part], fmi) for part in ("predictor", "averaging")))
        parameters.n_modes, parameters.modes = len(modes), modes
        signals = [
            [np.ascontiguousarray(one, dtype=np.float64) for one in (x_d, x, np.zeros(len(x_d)), np.zeros(len(x_d)))]
            for x_d, x in (first, second)
        ]
        runs = [_Run(len(one[0]), *(signal.ctypes.data_as(_DOUBLES) for signal in one)) for one in signals]
        if not self._library.replay(*map(ctypes.byref, (parameters, *runs))):
            raise SignalError("a prediction diverges")
        (_, _, cold, of_cold), (_, _, warm, of_warm) = signals
        return (cold, of_cold), (warm, of_warm)


def _filled(kind: type[ctypes.Structure], values: Mapping[str, float]) -> ctypes.Structure:
    """Return a struct with its values, whole numbers where it has them."""
    types = {field[0]: int if field[1] is ctypes.c_uint64 else float for field in kind._fields_}
    return kind(**{name: of(values[name]) for name, of in types.items()})
