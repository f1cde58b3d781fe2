"""FMI 3.0 functions of a shared library through ctypes, by the same methods as FMI 2.0's."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from ctypes import (
    CFUNCTYPE,
    POINTER,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_size_t,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from fmi2_library import OK, Functions

Logger = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)

VALUE_TYPES: dict[str, Any] = {
    "Float64": c_double,
    "Int32": c_int32,
    "Int64": c_int64,
    "Boolean": c_bool,
    "Float32": c_float,
    "Int8": c_int8,
    "UInt8": c_uint8,
    "Int16": c_int16,
    "UInt16": c_uint16,
    "UInt32": c_uint32,
    "UInt64": c_uint64,
    "String": c_char_p,
}
_STATES: dict[str, list[Any]] = {
    "GetFMUState": [POINTER(c_void_p)],
    "SetFMUState": [c_void_p],
    "FreeFMUState": [POINTER(c_void_p)],
    "SerializedFMUStateSize": [c_void_p, POINTER(c_size_t)],
    "SerializeFMUState": [c_void_p, c_char_p, c_size_t],
    "DeserializeFMUState": [c_char_p, c_size_t, POINTER(c_void_p)],
}
_VR, _N, _ANY = POINTER(c_uint), c_size_t, c_void_p
ABSENT: dict[str, list[Any]] = {
    **{
        name: []
        for name in (
            *("EnterEventMode", "EnterStepMode", "EnterConfigurationMode", "ExitConfigurationMode"),
            *("EvaluateDiscreteStates", "EnterContinuousTimeMode"),
        )
    },
    "GetClock": [_VR, _N, _ANY],
    "SetClock": [_VR, _N, _ANY],
    "GetIntervalDecimal": [_VR, _N, _ANY, _ANY],
    "GetIntervalFraction": [_VR, _N, _ANY, _ANY, _ANY],
    "GetShiftDecimal": [_VR, _N, _ANY],
    "GetShiftFraction": [_VR, _N, _ANY, _ANY],
    "SetIntervalDecimal": [_VR, _N, _ANY],
    "SetIntervalFraction": [_VR, _N, _ANY, _ANY],
    "SetShiftDecimal": [_VR, _N, _ANY],
    "SetShiftFraction": [_VR, _N, _ANY, _ANY],
    "UpdateDiscreteStates": [_ANY] * 6,
    "GetNumberOfVariableDependencies": [c_uint, _ANY],
    "GetVariableDependencies": [c_uint, _ANY, _ANY, _ANY, _ANY, _N],
    "GetDirectionalDerivative": [_VR, _N, _VR, _N, _ANY, _N, _ANY, _N],
    "GetAdjointDerivative": [_VR, _N, _VR, _N, _ANY, _N, _ANY, _N],
    "GetOutputDerivatives": [_VR, _N, _ANY, _ANY, _N],
    "CompletedIntegratorStep": [c_bool, _ANY, _ANY],
    "SetTime": [c_double],
    "SetContinuousStates": [_ANY, _N],
    "GetContinuousStateDerivatives": [_ANY, _N],
    "GetEventIndicators": [_ANY, _N],
    "GetContinuousStates": [_ANY, _N],
    "GetNominalsOfContinuousStates": [_ANY, _N],
    "GetNumberOfEventIndicators": [_ANY],
    "GetNumberOfContinuousStates": [_ANY],
    "ActivateModelPartition": [c_uint, c_double],
}
"""Functions for what the FMUs have not, with their arguments behind the instance."""

_SIGNATURES: dict[str, list[Any]] = {
    "SetDebugLogging": [c_bool, c_size_t, POINTER(c_char_p)],
    "EnterInitializationMode": [c_bool, c_double, c_double, c_bool, c_double],
    "ExitInitializationMode": [],
    "Terminate": [],
    "Reset": [],
    "DoStep": [c_double, c_double, c_bool, _ANY, _ANY, _ANY, _ANY],
    "GetBinary": [_VR, _N, _ANY, _ANY, _N],
    "SetBinary": [_VR, _N, _ANY, _ANY, _N],
    **_STATES,
    **ABSENT,
    **{
        f"{verb}{kind}": [_VR, _N, POINTER(ctype), _N] for verb in ("Get", "Set") for kind, ctype in VALUE_TYPES.items()
    },
}


class Library3(Functions):
    """The FMI 3.0 functions of one shared library, ``fmi3`` left out of their names.

    The functions for states can be called by FMI 2.0's names as well, so that one fuzzer serves both.

    Parameters
    ----------
    path : Path
        The shared library.
    description : Path
        The FMU's modelDescription.xml.
    """

    prefix = "fmi3"

    def __init__(self, path: Path, description: Path) -> None:
        self._dll = ctypes.CDLL(str(path.resolve()))
        for name, arguments in _SIGNATURES.items():
            function = getattr(self._dll, f"fmi3{name}")
            function.argtypes, function.restype = [c_void_p, *arguments], c_int
        create = self._dll.fmi3InstantiateCoSimulation
        create.restype, text = c_void_p, [c_char_p] * 3
        create.argtypes = [*text, *[c_bool] * 4, _VR, _N, c_void_p, Logger, c_void_p]
        self._dll.fmi3FreeInstance.argtypes, self._dll.fmi3FreeInstance.restype = [c_void_p], None
        root = ET.parse(description).getroot()
        self.guid = str(root.get("instantiationToken"))
        variables = {str(v.get("name")): v for v in root.iterfind("ModelVariables/*")}
        self.references = {name: int(str(v.get("valueReference"))) for name, v in variables.items()}
        self.kinds = {name: "Int64" if v.tag == "Enumeration" else v.tag for name, v in variables.items()}
        self.causalities = {name: str(v.get("causality")) for name, v in variables.items()}
        sizes = {name: v.find("Dimension") for name, v in variables.items()}
        self.sizes = {name: 1 if d is None else int(str(d.get("start"))) for name, d in sizes.items()}
        self.messages: list[tuple[int, str, str]] = []

        def log(environment: Any, status: int, category: bytes | None, message: bytes) -> None:
            self.messages.append((status, (category or b"").decode(), message.decode()))

        self.logger = Logger(log)

    def __getattr__(self, name: str) -> Callable[..., int]:
        return super().__getattr__(name.replace("FMUstate", "FMUState").replace("DeSerialize", "Deserialize"))

    @property
    def blocks(self) -> list[int]:
        """Blocks of memory that are not given back, where the library counts them (tests/c/counted.h); else none."""
        counted = getattr(self._dll, "counted_blocks", None)
        return list(range(counted())) if counted else []

    def instantiate(
        self,
        name: bytes | None = b"one",
        *,
        guid: str | None = None,
        resources: str | None = None,
        logging_on: bool = False,
        event_mode: bool = False,
        intermediate: int = 0,
        silent: bool = False,
    ) -> int | None:
        """Return an instance, or None if it was refused."""
        token = (self.guid if guid is None else guid).encode()
        place = None if resources is None else resources.encode()
        logger = Logger() if silent else self.logger
        instance: int | None = self._dll.fmi3InstantiateCoSimulation(
            name, token, place, False, logging_on, event_mode, True, None, intermediate, None, logger, None
        )
        return instance

    def begin(self, instance: int | None, start: float = 0.0, stop: float | None = None) -> int:
        """Set the experiment and enter Initialization Mode; return the status."""
        status: int = self.EnterInitializationMode(instance, False, 0.0, start, stop is not None, stop or 0.0)
        return status

    def do_step(self, instance: int | None, t: float, h: float) -> int:
        """Do a step and return the status; what it returns beside it must say that nothing is left to do."""
        flags, reached = [c_bool(True), c_bool(True), c_bool(True)], c_double(-1.0)
        status: int = self.DoStep(instance, t, h, True, *map(byref, flags), byref(reached))
        assert status != OK or not any(flag.value for flag in flags)
        assert status != OK or reached.value == t + h
        return status

    def time(self, instance: int | None) -> float | None:
        """Return the last communication point; None if that is refused."""
        try:
            return float(self.get(instance, "time"))
        except RuntimeError:
            return None

    def get(self, instance: int | None, name: str) -> Any:
        """Return one variable, of an array a list; raise RuntimeError if that is refused."""
        kind, n = self.kinds[name], self.sizes[name]
        values = (VALUE_TYPES[kind] * n)()
        status: int = getattr(self, f"Get{kind}")(instance, byref(c_uint(self.references[name])), 1, values, n)
        if status != OK:
            raise RuntimeError(self.messages[-1][2])
        return list(values) if n > 1 else values[0]

    def set(self, instance: int | None, name: str, value: Any) -> int:
        """Set one variable and return the status."""
        kind, n = self.kinds[name], self.sizes[name]
        values = (VALUE_TYPES[kind] * n)(*[value] * n)
        status: int = getattr(self, f"Set{kind}")(instance, byref(c_uint(self.references[name])), 1, values, n)
        return status

    def reals(self, instance: int) -> bytes:
        """Return all real numbers but the time, bit by bit."""
        names = [name for name, kind in self.kinds.items() if kind == "Float64" and name != "time"]
        n = sum(self.sizes[name] for name in names)
        values, places = (c_double * n)(), (c_uint * len(names))(*(self.references[name] for name in names))
        if self.GetFloat64(instance, places, len(names), values, n) != OK:
            raise RuntimeError(self.messages[-1][2])
        return bytes(values)
