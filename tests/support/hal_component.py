"""The HAL component for LinuxCNC over a stub of HAL (tests/integrations/hal_stub.c), stepped period by period."""

import ctypes
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
from built_once import built_once, shared_builds
from c_compiler import compiler
from places import ROOT

from hybridsep.base.signals import Array
from hybridsep.fmi.controllers import COMPONENTS, axis_files, component_files
from hybridsep.machines.machine import Machine

OUT, DELAYED, FB_JOINT, PREDICTED, ERROR, STD, STATE = range(7)
"""Columns of what a component writes; positions in machine units."""

_HEADERS = ("hal.h", "rtapi.h", "rtapi_app.h", "rtapi_math.h")


@cache
def _library(model: str) -> ctypes.CDLL:
    def build(folder: Path) -> None:
        for name, content in component_files(model).items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.replace(b"#pragma GCC optimize", b"// "))
        for name in _HEADERS:
            (folder / name).write_text("")
        source = ROOT / "tests" / "integrations" / "hal_stub.c"
        command = [*compiler(), "-std=gnu11", "-D_GNU_SOURCE", "-O0", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"]
        command += ["-Wno-unused-function", "-Wno-ignored-qualifiers", f"-I{folder}"]
        command += [f'-DCOMPONENT="{COMPONENTS[model]}.c"']
        done = subprocess.run(
            [*command, str(source), "-o", str(folder / "component.so"), "-lm"], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr

    folder = built_once(shared_builds() / f"hal_{model}", build)
    loaded = ctypes.CDLL(str(folder / "component.so"))
    loaded.stub_scale.restype = ctypes.c_double
    loaded.stub_message.restype = ctypes.c_char_p
    loaded.stub_parameters.argtypes = [ctypes.c_double, ctypes.c_int]
    loaded.stub_step.argtypes = [ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
    return loaded


class Component:
    """One axis, loaded; a process has one of a model at a time.

    ``folder``: for the axis' own folder; ``model``: {"SepCompensator", "HybridPredictor"}.
    """

    def __init__(self, machine: Machine, folder: Path, model: str = "SepCompensator") -> None:
        self._loaded, self.machine = _library(model), machine
        axis = folder / machine.name
        axis.mkdir(parents=True, exist_ok=True)
        for name, content in axis_files(machine, model).items():
            (axis / name).write_bytes(content)
        self._axis = ctypes.create_string_buffer(bytes(axis))  # the component keeps the pointer
        assert self._loaded.stub_load(self._axis) == 0, self.message
        self.scale, self.look_ahead = float(self._loaded.stub_scale()), int(self._loaded.stub_look_ahead())
        self._inputs, self._outputs = np.zeros(5), np.zeros(7, dtype=np.float64)

    def set(self, *, scale: float | None = None, model: int = 2) -> None:
        """Set the parameters."""
        self._loaded.stub_parameters(self.scale if scale is None else scale, model)

    def step(
        self,
        cmd: float,
        fb: float,
        *,
        active: bool = True,
        enable: bool = True,
        reset: bool = False,
        period: float = 1.0,
    ) -> Array:
        """Do a period, relative to the machine's interval; return what the pins show, ``(7,)``."""
        self._inputs[:] = cmd, fb, active, enable, reset
        ns = round(1e9 * period * self.machine.T_s)
        self._loaded.stub_step(ns, self._inputs.ctypes.data, self._outputs.ctypes.data)
        return np.array(self._outputs)

    def break_model(self) -> None:
        """Let the model refuse the next sample."""
        self._loaded.stub_break()

    @property
    def messages(self) -> int:
        """Number of messages since it was loaded."""
        return int(self._loaded.stub_messages())

    @property
    def message(self) -> str:
        """The last one."""
        return str(self._loaded.stub_message().decode())

    @property
    def longest_name(self) -> int:
        """Letters of the longest name of a pin, a parameter or a function."""
        return int(self._loaded.stub_longest_name())
