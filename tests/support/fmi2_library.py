"""FMI 2.0 functions of a shared library through ctypes, and the checksum of a serialised state."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any, ClassVar
from xml.etree import ElementTree as ET

HEADER_SIZE, CHECKSUM_PLACE = 120, 72
"""Bytes of a serialised state before its values, and where its checksum stands."""

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

Logger = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Allocate = CFUNCTYPE(c_void_p, c_size_t, c_size_t)
Free = CFUNCTYPE(None, c_void_p)


class Callbacks(ctypes.Structure):
    """``fmi2CallbackFunctions``."""

    _fields_ = [
        ("logger", Logger),
        ("allocate", Allocate),
        ("free", Free),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


VALUE_TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_SIGNATURES: dict[str, list[Any]] = {
    "SetDebugLogging": [c_void_p, c_int, c_size_t, POINTER(c_char_p)],
    "SetupExperiment": [c_void_p, c_int, c_double, c_double, c_int, c_double],
    "EnterInitializationMode": [c_void_p],
    "ExitInitializationMode": [c_void_p],
    "Terminate": [c_void_p],
    "Reset": [c_void_p],
    "GetFMUstate": [c_void_p, POINTER(c_void_p)],
    "SetFMUstate": [c_void_p, c_void_p],
    "FreeFMUstate": [c_void_p, POINTER(c_void_p)],
    "SerializedFMUstateSize": [c_void_p, c_void_p, POINTER(c_size_t)],
    "SerializeFMUstate": [c_void_p, c_void_p, c_char_p, c_size_t],
    "DeSerializeFMUstate": [c_void_p, c_char_p, c_size_t, POINTER(c_void_p)],
    "GetDirectionalDerivative": [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_void_p],
    "SetRealInputDerivatives": [c_void_p, c_void_p, c_size_t, c_void_p, c_void_p],
    "GetRealOutputDerivatives": [c_void_p, c_void_p, c_size_t, c_void_p, c_void_p],
    "DoStep": [c_void_p, c_double, c_double, c_int],
    "CancelStep": [c_void_p],
    "GetStatus": [c_void_p, c_int, POINTER(c_int)],
    "GetRealStatus": [c_void_p, c_int, POINTER(c_double)],
    "GetIntegerStatus": [c_void_p, c_int, POINTER(c_int)],
    "GetBooleanStatus": [c_void_p, c_int, POINTER(c_int)],
    "GetStringStatus": [c_void_p, c_int, POINTER(c_char_p)],
}
for _kind, _type in VALUE_TYPES.items():
    _SIGNATURES[f"Get{_kind}"] = _SIGNATURES[f"Set{_kind}"] = [c_void_p, POINTER(c_uint), c_size_t, POINTER(_type)]


class Functions:
    """FMI functions of one shared library, the prefix left out of their names, and its states."""

    prefix: ClassVar[str]
    _dll: ctypes.CDLL

    def __getattr__(self, name: str) -> Callable[..., int]:
        function: Callable[..., int] = getattr(self._dll, f"{self.prefix}{name}")
        return function

    def save(self, component: int | None) -> bytes:
        """Return the serialised state."""
        state, size = c_void_p(), c_size_t()
        assert self.GetFMUstate(component, byref(state)) == OK
        assert self.SerializedFMUstateSize(component, state, byref(size)) == OK
        block = ctypes.create_string_buffer(size.value)
        assert self.SerializeFMUstate(component, state, block, size.value) == OK
        assert self.FreeFMUstate(component, byref(state)) == OK
        return block.raw

    def restore(self, component: int | None, block: bytes) -> int:
        """Take over a serialised state and return the first status that is not OK."""
        state = c_void_p()
        status = self.DeSerializeFMUstate(component, block, len(block), byref(state))
        if status == OK:
            status = self.SetFMUstate(component, state)
            assert self.FreeFMUstate(component, byref(state)) == OK
        return status


class Library(Functions):
    """The FMI functions of one shared library, ``fmi2`` left out of their names, and what passed its callbacks.

    Parameters
    ----------
    path : Path
        The shared library.
    description : Path
        The FMU's modelDescription.xml.
    largest : int
        Bytes beyond which the importer has no memory for a block.
    """

    prefix = "fmi2"

    def __init__(self, path: Path, description: Path, largest: int = 1 << 26) -> None:
        self._dll = ctypes.CDLL(str(path.resolve()))
        for name, arguments in _SIGNATURES.items():
            function = getattr(self._dll, f"fmi2{name}")
            function.argtypes, function.restype = arguments, c_int
        self._dll.fmi2Instantiate.argtypes = [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]
        self._dll.fmi2Instantiate.restype = c_void_p
        self._dll.fmi2FreeInstance.argtypes = [c_void_p]
        self._dll.fmi2FreeInstance.restype = None
        root = ET.parse(description).getroot()
        self.guid = str(root.get("guid"))
        variables = root.findall("ModelVariables/ScalarVariable")
        self.references = {str(v.get("name")): int(str(v.get("valueReference"))) for v in variables}
        tags = {str(v.get("name")): v[0].tag for v in variables}
        self.kinds = {name: "Integer" if tag == "Enumeration" else tag for name, tag in tags.items()}
        self.causalities = {str(v.get("name")): str(v.get("causality")) for v in variables}
        self.messages: list[tuple[int, str, str]] = []
        self.blocks: dict[int, int] = {}
        self.allocations = 0
        libc = ctypes.CDLL(None)
        libc.calloc.argtypes, libc.calloc.restype = [c_size_t, c_size_t], c_void_p
        libc.free.argtypes, libc.free.restype = [c_void_p], None

        def log(environment: Any, name: bytes, status: int, category: bytes | None, message: bytes) -> None:
            self.messages.append((status, (category or b"").decode(), message.decode()))

        def allocate(count: int, size: int) -> int | None:
            if count * size > largest:
                return None
            block = libc.calloc(count, size)
            self.allocations += 1
            self.blocks[block] = count * size
            return int(block)

        def free(block: int) -> None:
            del self.blocks[block]
            libc.free(block)

        self.callbacks = Callbacks(Logger(log), Allocate(allocate), Free(free), None, None)

    def instantiate(
        self,
        name: bytes | None = b"one",
        *,
        kind: int = 1,
        guid: str | None = None,
        resources: str | None = None,
        callbacks: Callbacks | None = None,
        logging_on: bool = False,
    ) -> int | None:
        """Return a component, or None if it was refused; without callbacks those that log and count."""
        instance: int | None = self._dll.fmi2Instantiate(
            name,
            kind,
            (self.guid if guid is None else guid).encode(),
            None if resources is None else resources.encode(),
            ctypes.addressof(self.callbacks if callbacks is None else callbacks),
            0,
            int(logging_on),
        )
        return instance

    def instantiate_bare(self) -> int | None:
        """Return a component that was given no callbacks at all."""
        instance: int | None = self._dll.fmi2Instantiate(b"bare", 1, self.guid.encode(), None, None, 0, 0)
        return instance

    def get(self, component: int | None, name: str) -> Any:
        """Return one variable; raise RuntimeError if that is refused."""
        kind = self.kinds[name]
        value = VALUE_TYPES[kind]()
        reference = c_uint(self.references[name])
        status: int = getattr(self, f"Get{kind}")(component, byref(reference), 1, byref(value))
        if status != OK:
            raise RuntimeError(self.messages[-1][2])
        return value.value

    def set(self, component: int | None, name: str, value: Any) -> int:
        """Set one variable and return the status."""
        kind = self.kinds[name]
        reference = c_uint(self.references[name])
        status: int = getattr(self, f"Set{kind}")(component, byref(reference), 1, byref(VALUE_TYPES[kind](value)))
        return status

    def reals(self, component: int) -> bytes:
        """Return all Reals, bit by bit."""
        places = [self.references[name] for name, kind in self.kinds.items() if kind == "Real"]
        values = (c_double * len(places))()
        status = self.GetReal(component, (c_uint * len(places))(*places), len(places), values)
        if status != OK:
            raise RuntimeError(self.messages[-1][2])
        return bytes(values)


def repair_checksum(block: bytearray) -> None:
    """Give a changed block the checksum that fits, so that what lies behind it is tested too."""
    if len(block) < HEADER_SIZE:
        return
    block[CHECKSUM_PLACE : CHECKSUM_PLACE + 8] = bytes(8)
    block[CHECKSUM_PLACE : CHECKSUM_PLACE + 8] = struct.pack(
        "<Q", _fnv(block[:HEADER_SIZE]) ^ _fnv(block[HEADER_SIZE:])
    )


def _fnv(content: bytes | bytearray) -> int:
    result = 14695981039346656037
    for byte in content:
        result = (result ^ byte) * 1099511628211 & 0xFFFFFFFFFFFFFFFF
    return result
