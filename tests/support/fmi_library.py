"""FMI functions of a native FMU's library, declared by fmpy, for calls that no importer makes; both versions alike."""

import ctypes
import math
from collections.abc import Callable
from ctypes import byref, c_bool, c_double, c_size_t, c_uint, c_void_p, create_string_buffer
from pathlib import Path
from typing import Any, ClassVar

import fmpy
from fmpy import fmi2, fmi3

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
STATES = ("instantiated", "Initialization Mode", "stepping", "terminated")

ABSENT = (
    *("EnterEventMode", "EnterStepMode", "EvaluateDiscreteStates"),
    *("EnterContinuousTimeMode", "GetClock", "SetClock", "GetIntervalDecimal", "GetIntervalFraction"),
    *("GetShiftDecimal", "GetShiftFraction", "SetIntervalDecimal", "SetIntervalFraction", "UpdateDiscreteStates"),
    *("GetNumberOfVariableDependencies", "GetVariableDependencies"),
    *("GetAdjointDerivative", "GetOutputDerivatives", "CompletedIntegratorStep", "SetTime", "SetContinuousStates"),
    *("GetContinuousStateDerivatives", "GetEventIndicators", "GetContinuousStates", "GetNominalsOfContinuousStates"),
    *("GetNumberOfEventIndicators", "GetNumberOfContinuousStates", "ActivateModelPartition"),
)
"""Functions of FMI 3.0 for what the FMUs have not: they read nothing but the instance, and are given nothing else."""


class Library:
    """Functions of FMI 2.0, ``fmi2`` left out of their names, with their statuses, and what passed the callbacks.

    ``folder``: an unpacked FMU; ``largest``: bytes beyond which the importer has no memory for a block.
    ``references``, ``kinds``, ``causalities``, ``sizes``: by the variables' names; ``messages``: each (status,
    category, text); ``blocks``: bytes of the blocks of memory that were not given back.
    """

    version, slave = 2, fmi2.FMU2Slave
    values: ClassVar[dict[str, Any]] = {
        "Real": ctypes.c_double,
        "Integer": ctypes.c_int,
        "Boolean": ctypes.c_int,
        "String": ctypes.c_char_p,
    }
    enumeration, real = "Integer", "Real"
    initialization: tuple[Any, ...] = ()  # arguments of EnterInitializationMode

    def __init__(self, folder: Path, largest: int = 1 << 26) -> None:
        described = fmpy.read_model_description(str(folder), validate=False)
        self.guid = str(described.guid)
        where = {"modelIdentifier": described.coSimulation.modelIdentifier, "unzipDirectory": str(folder)}
        self._loaded: Any = self.slave(guid=self.guid, **where)
        self._dll = self._loaded.dll
        variables = {v.name: v for v in described.modelVariables}
        self.references = {name: int(v.valueReference) for name, v in variables.items()}
        self.kinds = {n: self.enumeration if v.type == "Enumeration" else v.type for n, v in variables.items()}
        self.causalities = {name: str(v.causality) for name, v in variables.items()}
        self.sizes = {name: v.shape[0] if v.shape else 1 for name, v in variables.items()}
        self.messages: list[tuple[int, str, str]] = []
        self.allocated: dict[int, int] = {}
        self.allocations = 0
        self._largest = largest
        self.callbacks = self._callbacks()

    def _callbacks(self) -> Any:
        libc = ctypes.CDLL(None)
        libc.calloc.argtypes, libc.calloc.restype = [c_size_t, c_size_t], c_void_p
        libc.free.argtypes, libc.free.restype = [c_void_p], None

        def log(environment: Any, name: bytes, status: int, category: bytes | None, message: bytes) -> None:
            self.messages.append((status, (category or b"").decode(), message.decode()))

        def allocate(count: int, size: int) -> int | None:
            if count * size > self._largest:
                return None
            block = libc.calloc(count, size)
            self.allocations += 1
            self.allocated[block] = count * size
            return int(block)

        def free(block: int) -> None:
            del self.allocated[block]
            libc.free(block)

        return self.with_memory(allocate, fmi2.fmi2CallbackLoggerTYPE(log), fmi2.fmi2CallbackFreeMemoryTYPE(free))

    def with_memory(self, allocate: Callable[[int, int], int | None], logger: Any = None, free: Any = None) -> Any:
        """Return callbacks that allocate otherwise."""
        given = fmi2.fmi2CallbackFunctions()
        given.logger = self.callbacks.logger if logger is None else logger
        given.freeMemory = self.callbacks.freeMemory if free is None else free
        given.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(allocate)
        return given

    def __getattr__(self, name: str) -> Callable[..., Any]:
        function: Callable[..., Any] = getattr(self._dll, f"fmi{self.version}{name}")
        return function

    @property
    def blocks(self) -> dict[int, int]:
        return self.allocated

    def refused(self, status: int, said: str) -> None:
        """Check that a call was refused, with a text in the last message."""
        assert status == ERROR
        assert said in self.messages[-1][2]

    def instantiate(
        self,
        name: bytes | None = b"one",
        *,
        guid: str | None = None,
        resources: str | None = None,
        logging_on: bool = False,
        callbacks: Any = None,
        **odd: Any,
    ) -> int | None:
        """Return an instance, or None if it was refused."""
        # Without callbacks those that log and count, none for False; odd are the arguments that only one version has
        token, place = (self.guid if guid is None else guid).encode(), None if resources is None else resources.encode()
        instance: int | None = self._instantiated(name, token, place, logging_on, callbacks, odd)
        return instance

    def _instantiated(self, name: Any, token: Any, place: Any, logging_on: bool, callbacks: Any, odd: Any) -> Any:
        given = byref(self.callbacks) if callbacks is None else callbacks and byref(callbacks)
        kind = odd.get("kind", 1)
        return self.Instantiate(name, kind, token, place, given or None, False, logging_on)

    def instance_in(self, state: str) -> int:
        """Return a new instance, brought into one of :data:`STATES` by legal calls."""
        instance = self.instantiate()
        assert instance is not None
        for name in ("EnterInitializationMode", "ExitInitializationMode", "Terminate")[: STATES.index(state)]:
            given = self.initialization if name.startswith("Enter") else ()
            assert getattr(self, name)(instance, *given) == OK
        return instance

    def begin(self, instance: int | None, start: float = 0.0, stop: float | None = None) -> int:
        """Set the experiment and enter Initialization Mode; return the first status that is not OK."""
        status: int = self.SetupExperiment(instance, False, 0.0, start, stop is not None, stop or 0.0)
        return status or int(self.EnterInitializationMode(instance))

    def do_step(self, instance: int | None, t: float, h: float) -> int:
        """Do a step and return the status."""
        return int(self.DoStep(instance, t, h, True))

    def time(self, instance: int | None) -> float | None:
        """Return the last communication point; None if that is refused."""
        reached = c_double()
        return reached.value if self.GetRealStatus(instance, 2, byref(reached)) == OK else None

    def access(self, verb: str, kind: str, instance: int | None, places: Any, count: int, values: Any, n: int) -> int:
        """Get or set values and return the status."""
        return int(getattr(self, f"{verb}{kind}")(instance, places, count, values))

    def get(self, instance: int | None, name: str) -> Any:
        """Return one variable, of an array a list; raise RuntimeError if that is refused."""
        kind, n = self.kinds[name], self.sizes[name]
        values = (self.values[kind] * n)()
        if self.access("Get", kind, instance, byref(c_uint(self.references[name])), 1, values, n) != OK:
            raise RuntimeError(self.messages[-1][2])
        return list(values) if n > 1 else values[0]

    def set(self, instance: int | None, name: str, value: Any) -> int:
        """Set one variable and return the status."""
        kind, n = self.kinds[name], self.sizes[name]
        values = (self.values[kind] * n)(*[value] * n)
        return self.access("Set", kind, instance, byref(c_uint(self.references[name])), 1, values, n)

    def reals(self, instance: int | None) -> bytes:
        """Return all real numbers but the time, bit by bit; raise RuntimeError if that is refused."""
        names = [name for name, kind in self.kinds.items() if kind == self.real and name != "time"]
        n = sum(self.sizes[name] for name in names)
        values, places = (c_double * n)(), (c_uint * len(names))(*(self.references[name] for name in names))
        if self.access("Get", self.real, instance, places, len(names), values, n) != OK:
            raise RuntimeError(self.messages[-1][2])
        return bytes(values)

    def save(self, instance: int | None) -> bytes:
        """Return the serialised state."""
        state, size = c_void_p(), c_size_t()
        assert self.GetFMUstate(instance, byref(state)) == OK
        assert self.SerializedFMUstateSize(instance, state, byref(size)) == OK
        block = create_string_buffer(size.value)
        assert self.SerializeFMUstate(instance, state, self.block(block), size.value) == OK
        assert self.FreeFMUstate(instance, byref(state)) == OK
        return block.raw

    def restore(self, instance: int | None, block: bytes) -> int:
        """Take over a serialised state and return the first status that is not OK."""
        state = c_void_p()
        given = self.block(create_string_buffer(block, len(block)))
        status: int = self.DeSerializeFMUstate(instance, given, len(block), byref(state))
        if status == OK:
            status = self.SetFMUstate(instance, state)
            assert self.FreeFMUstate(instance, byref(state)) == OK
        return status

    def block(self, block: Any) -> Any:
        """Return bytes as the functions of this version take them."""
        return block


class Library3(Library):
    """Functions of FMI 3.0; those for states can be called by FMI 2.0's names as well."""

    # Blocks of memory are counted where the library counts them (tests/c/counted.h)

    version, slave = 3, fmi3.FMU3Slave
    values: ClassVar[dict[str, Any]] = {
        kind: getattr(fmi3, f"fmi3{kind}")
        for kind in (
            *("Float64", "Int32", "Int64", "Boolean", "Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32"),
            *("UInt64", "String"),
        )
    }
    enumeration, real = "Int64", "Float64"
    initialization = (False, 0.0, 0.0, False, 0.0)

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        for name in ABSENT:
            getattr(self, name).argtypes = [c_void_p]

    def _callbacks(self) -> Any:
        def log(environment: Any, status: int, category: bytes | None, message: bytes) -> None:
            self.messages.append((status, (category or b"").decode(), message.decode()))

        return fmi3.fmi3LogMessageCallback(log)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return super().__getattr__(name.replace("FMUstate", "FMUState").replace("DeSerialize", "Deserialize"))

    @property
    def blocks(self) -> dict[int, int]:
        counted = getattr(self._dll, "counted_blocks", None)
        return dict.fromkeys(range(counted()), 0) if counted else {}

    def _instantiated(self, name: Any, token: Any, place: Any, logging_on: bool, callbacks: Any, odd: Any) -> Any:
        logger = self.callbacks if callbacks is None else callbacks or fmi3.fmi3LogMessageCallback()
        none = fmi3.fmi3IntermediateUpdateCallback()
        event_mode, intermediate = odd.get("event_mode", False), odd.get("intermediate", 0)
        given = (False, logging_on, event_mode, True, None, intermediate, None, logger, none)
        return self.InstantiateCoSimulation(name, token, place, *given)

    def begin(self, instance: int | None, start: float = 0.0, stop: float | None = None) -> int:
        return int(self.EnterInitializationMode(instance, False, 0.0, start, stop is not None, stop or 0.0))

    def do_step(self, instance: int | None, t: float, h: float) -> int:
        """Do a step; what it returns beside the status must say that nothing is left to do."""
        flags, reached = [c_bool(True), c_bool(True), c_bool(True)], c_double(-1.0)
        status = int(self.DoStep(instance, t, h, True, *map(byref, flags), byref(reached)))
        assert status != OK or not any(flag.value for flag in flags)
        assert status != OK or reached.value == t + h
        return status

    def time(self, instance: int | None) -> float | None:
        try:
            return float(self.get(instance, "time"))
        except RuntimeError:
            return None

    def access(self, verb: str, kind: str, instance: int | None, places: Any, count: int, values: Any, n: int) -> int:
        return int(getattr(self, f"{verb}{kind}")(instance, places, count, values, n))

    def block(self, block: Any) -> Any:
        return ctypes.cast(block, ctypes.POINTER(ctypes.c_uint8))


def library_of(folder: Path) -> Library:
    """Return the functions of an unpacked FMU, of its version of FMI."""
    text = (folder / "modelDescription.xml").read_text(encoding="utf-8")
    return (Library3 if 'fmiVersion="3' in text else Library)(folder)


def steps(fmu: Library, instance: int | None, first: int, last: int) -> None:
    """Step through samples ``first … last - 1`` of a made-up motion."""
    for k in range(first, last):
        assert fmu.set(instance, "x_d_ahead", 1e-3 * math.sin(0.02 * k)) == OK
        assert fmu.set(instance, "x_meas", 1e-3 * math.sin(0.02 * k - 2.1) + 1e-5 * math.cos(0.3 * k)) == OK
        assert fmu.do_step(instance, k * 1e-3, 1e-3) == OK
