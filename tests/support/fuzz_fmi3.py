"""Random calls of an FMU's FMI 3.0 functions, with the checks of the program for FMI 2.0.

Run as a program: ``python tests/support/fuzz_fmi3.py LIBRARY MODEL_DESCRIPTION RESOURCES --seconds 600 --seed 1``.
Memory that is not given back is found in a library that is compiled with ``-include tests/c/counted.h``.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from ctypes import byref, c_bool, c_char_p, c_double, c_uint, c_void_p
from typing import Any

from fmi2_library import ERROR, OK
from fmi3_library import ABSENT, VALUE_TYPES, Library3
from fuzz_fmi2 import Fuzzer, main


class Fuzzer3(Fuzzer):
    """Calls at random of FMI 3.0's functions."""

    def run(self, seconds: float) -> None:
        """Check that the library counts its blocks, and go on as for FMI 2.0."""
        instance = self.library.instantiate()
        if not self.library.blocks:
            raise AssertionError("the library does not count its blocks: compile it with tests/c/counted.h")
        self.library.FreeInstance(instance)
        super().run(seconds)

    def _odd_kind(self, odd: bool) -> dict[str, Any]:
        return {
            "event_mode": odd and self.random.random() < 0.3,
            "intermediate": self.random.choice([0, 3]) if odd else 0,
        }

    def _begin(self, component: int | None, start: float) -> None:
        stop = self.random.random() < 0.1
        self._call("EnterInitializationMode", component, False, 0.0, start, stop, self._number())

    def _do_step(self, component: int | None, t: float, h: float) -> int:
        flags, reached = [c_bool(True) for _ in range(3)], c_double(-1.0)
        places: list[Any] = [*map(byref, flags), byref(reached)]
        if self.random.random() < 0.01:
            places[self.random.randrange(4)] = None
        status = self._call("DoStep", component, t, h, self.random.random() < 0.5, *places)
        if status == OK and (any(flag.value for flag in flags) or reached.value != t + h):
            raise AssertionError("a step is done in part")
        return status

    def _reached(self, component: int) -> float | None:
        reached: float | None = self.library.time(component)
        return reached

    def _slopes(self, component: Any, names: Sequence[str], odd: bool) -> None:
        """FMI 3.0 has none; an access of a whole window in their place."""
        windows = [name for name, size in self.library.sizes.items() if size > 1]
        if windows:
            with suppress(RuntimeError):  # of a start value that is no position
                self.library.get(component, self.random.choice(windows))

    def _access(self) -> None:
        component = self._component()
        kind = self.random.choice(["Float64", "Float64", "Int32", "Int64", "Boolean", *VALUE_TYPES])
        count, n = self.random.randint(0, 8), len(self.library.references)
        sizes = {self.library.references[name]: size for name, size in self.library.sizes.items()}
        last = [n - 1 - self.random.randrange(6), n, 2**32 - 1]
        places = [
            self.random.choice([self.random.randrange(n), self.random.randrange(30), *last]) for _ in range(count)
        ]
        n_values = sum(sizes.get(place, 1) for place in places)
        if self.random.random() < 0.1:
            n_values += self.random.choice([-1, 1])
        values = (VALUE_TYPES[kind] * max(n_values, 0))()
        for i in range(len(values)):
            if kind.startswith("Float"):
                values[i] = self._number()
            elif kind == "Boolean":
                values[i] = self.random.random() < 0.5
            elif kind != "String":
                values[i] = self.random.choice([0, 1, -1, 50, 2**31 - 1, -(2**31), 2**63 - 1])
        null = self.random.random()
        self._call(
            self.random.choice(["Get", "Set"]) + kind,
            component,
            None if null < 0.03 else (c_uint * count)(*places),
            count,
            None if null > 0.97 else values,
            max(n_values, 0),
        )

    def _plain(self) -> None:
        component = self._component()
        name = self.random.choice(["ExitInitializationMode", "Terminate", "Reset", "SetDebugLogging"])
        if name != "SetDebugLogging":
            self._call(name, component)
            return
        names = (c_char_p * 4)(b"logAll", b"logStatusError", b"other", None)
        self._call(name, component, self.random.random() < 0.5, 4, self.random.choice([None, names]))
        self._call(name, component, True, 0, None)

    def _status(self) -> None:
        """Call what is absent."""
        for name in self.random.sample(list(ABSENT), 5):
            given = [
                None if kind is c_void_p or hasattr(kind, "contents") else kind(self.random.randint(0, 9))
                for kind in ABSENT[name]
            ]
            if self._call(name, self._component(), *given) != ERROR:
                raise AssertionError(f"{name} is absent, and was not refused")


if __name__ == "__main__":
    main(Fuzzer3, Library3)
