"""Random calls of an FMU's FMI 2.0 functions.

Run as a program: ``python tests/support/fuzz_fmi2.py LIBRARY MODEL_DESCRIPTION RESOURCES_URI --seconds 600 --seed 1``.
A finding is a crash, a sanitizer's report, or one of the checks here: a refusal without a message, a refused step that
changed a value, a block of memory that was not given back.
"""

from __future__ import annotations

import argparse
import ctypes
import random
import sys
import time
from collections.abc import Callable, Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

from fmi2_library import DISCARD, ERROR, OK, VALUE_TYPES, Library, repair_checksum


class Fuzzer:
    """Calls at random, on up to three instances, of which about half are what an importer would do.

    What FMI 3.0 has by other arguments is in methods of its own (fuzz_fmi3.py).
    """

    def __init__(self, library: Any, resources: str, seed: int) -> None:
        self.library, self.resources = library, resources
        self.random = random.Random(seed)
        self.instances: list[int] = []
        self.states: list[c_void_p] = []
        self.blocks: list[bytes] = [b""]
        self.times: dict[int, float] = {}
        self.calls = self.refused = self.steps = 0

    def run(self, seconds: float) -> None:
        """Call until the time is over, then free everything and look for lost blocks."""
        end = time.monotonic() + seconds
        actions = [
            (6, self._instantiate),
            (2, self._free),
            (8, self._initialise),
            (40, self._steps),
            (20, self._access),
            (12, self._state),
            (10, self._plain),
            (2, self._status),
        ]
        weights, functions = zip(*actions, strict=True)
        while time.monotonic() < end:
            self.random.choices(functions, weights)[0]()
            self.library.messages.clear()
        while self.instances:
            self._free()
        if self.library.blocks:
            raise AssertionError(f"{len(self.library.blocks)} blocks of memory were not given back")

    def _call(self, name: str, component: int | None, *arguments: Any) -> int:
        self.library.messages.clear()
        status: int = getattr(self.library, name)(component, *arguments)
        self.calls += 1
        self.refused += status == ERROR
        if status not in (OK, DISCARD, ERROR):
            raise AssertionError(f"{name} returned {status}")
        if status == ERROR and component is not None and not self.library.messages:
            raise AssertionError(f"{name} was refused without a message")
        return status

    def _component(self) -> int | None:
        return self.random.choice(self.instances) if self.instances and self.random.random() < 0.98 else None

    def _number(self) -> float:
        return self.random.choice(
            [
                0.0,
                1e-3,
                -1e-3,
                1.0,
                1e300,
                -1e300,
                5e-324,
                float("nan"),
                float("inf"),
                -float("inf"),
                self.random.gauss(0, 1),
            ]
        )

    def _instantiate(self) -> None:
        if len(self.instances) == 3:
            return self._free()
        odd = self.random.random() < 0.2
        instance = self.library.instantiate(
            self.random.choice([None, b""]) if odd else b"i%d" % len(self.instances),
            guid="{}" if odd and self.random.random() < 0.5 else None,
            resources=self.random.choice([None, "file://%00", "http://x/y", "file:", "%", *7 * [self.resources]]),
            logging_on=self.random.random() < 0.5,
            **self._odd_kind(odd),
        )
        if instance is not None:
            self.instances.append(instance)
            self.times[instance] = 0.0
        return None

    def _odd_kind(self, odd: bool) -> dict[str, Any]:
        """Return further arguments of an instantiation."""
        return {"kind": self.random.choice([0, 1, 7]) if odd else 1}

    def _begin(self, component: int | None, start: float) -> None:
        """Set an experiment and most often enter Initialization Mode."""
        self._call("SetupExperiment", component, 0, 0.0, start, self.random.random() < 0.1, self._number())
        if self.random.random() < 0.9:
            self._call("EnterInitializationMode", component)

    def _do_step(self, component: int | None, t: float, h: float) -> int:
        return self._call("DoStep", component, t, h, 1)

    def _reached(self, component: int) -> float | None:
        """Return the last communication point; None where that is refused."""
        reached = c_double()
        return reached.value if self.library.GetRealStatus(component, 2, byref(reached)) == OK else None

    def _free(self) -> None:
        if not self.instances:
            return
        if len(self.instances) == 1:
            for state in self.states:
                self._call("FreeFMUstate", self.instances[0], byref(state))
            self.states.clear()
        instance = self.instances.pop(self.random.randrange(len(self.instances)))
        self.library.FreeInstance(instance)

    def _initialise(self) -> None:
        component = self._component()
        if self.random.random() < 0.7:
            self._call("Reset", component)
        start = self.random.choice([0.0, 0.0, 12.5, self._number()])
        self._begin(component, start)
        if component is None:
            return
        ranges = {
            "Np": (20, 130),
            "p": (1, 20),
            "q": (0, 19),
            "dead_time": (0, 10),
            "preview": (150, 260),
            "spacing": (1, 2),
            "no_reversal": (0, 1),
            "compensate": (0, 2),
            "trajectory": (0, 2),
            "seed": (0, 9),
        }
        for name, (low, high) in ranges.items():
            if name in self.library.references and (name == "p" or self.random.random() < 0.5):
                odd = [0, -1, 100_000, 2**31 - 1, -(2**31)]
                value = self.random.randint(low, high) if self.random.random() < 0.97 else self.random.choice(odd)
                self.library.set(component, name, value)
        for name in ("x_d_ahead", "x_d"):
            if self.library.causalities.get(name) == "input":
                self.library.set(component, name, self.random.choice([0.0, 0.1, self._number()]))
        if self._call("ExitInitializationMode", component) == OK:
            self.times[component] = start

    def _reals(self, component: int) -> bytes:
        """Return all Reals, bit by bit; none where they are refused, as outputs of an invalid start are."""
        try:
            return bytes(self.library.reals(component))
        except RuntimeError:
            return b""

    def _steps(self) -> None:
        component = self._component()
        if component is None:
            self._do_step(None, 0.0, 1e-3)
            return
        names = [name for name, causality in self.library.causalities.items() if causality == "input"]
        for _ in range(self.random.randint(1, 100)):
            odd = self.random.random() < 0.05
            for name in names:
                self.library.set(component, name, self._number() if odd else self.random.gauss(0, 1e-2))
            t = self.times[component]
            usual = self.random.choice([1e-3, 1e-3, 3e-4, 8e-3, self.random.uniform(0.0, 0.05)])
            h = self.random.choice([1e-7, 0.0, -1e-3, 1.3, self._number()]) if odd else usual
            if self.random.random() < 0.1:
                self._slopes(component, names, odd)
            before = self._reals(component)
            if self._do_step(component, self._number() if self.random.random() < 0.02 else t, h) == OK:
                self.times[component] = t + h
                self.steps += 1
            elif before != self._reals(component):
                raise AssertionError("a refused step changed a value")

    def _slopes(self, component: Any, names: Sequence[str], odd: bool) -> None:
        n = len(names)
        references = (c_uint * n)(*(self.library.references[name] for name in names))
        orders = (c_int * n)(*(self.random.choice([0, 1, 2]) if odd else 1 for _ in names))
        slopes = (c_double * n)(*(self._number() if odd else self.random.gauss(0, 0.1) for _ in names))
        self._call("SetRealInputDerivatives", component, references, n, orders, slopes)

    def _access(self) -> None:
        component = self._component()
        kind = self.random.choice(["Real", "Real", "Integer", "Boolean", "String"])
        count = self.random.randint(0, 8)
        n = len(self.library.references)
        places = [
            self.random.choice([self.random.randrange(n), self.random.randrange(30), n, 2**32 - 1])
            for _ in range(count)
        ]
        references = (c_uint * count)(*places)
        values = (VALUE_TYPES[kind] * count)()
        for i in range(count):
            if kind == "Real":
                values[i] = self._number()
            elif kind != "String":
                values[i] = self.random.choice([0, 1, -1, 50, 2**31 - 1, -(2**31)])
        null = self.random.random()
        self._call(
            self.random.choice(["Get", "Set"]) + kind,
            component,
            None if null < 0.03 else references,
            count,
            None if null > 0.97 else values,
        )

    def _state(self) -> None:
        component = self._component()
        action = self.random.randrange(6)
        if action == 0 and len(self.states) < 10:
            state = c_void_p()
            if self._call("GetFMUstate", component, byref(state)) == OK:
                self.states.append(state)
        elif action == 1:
            self._call("GetFMUstate", component, byref(self.random.choice(self.states)) if self.states else None)
        elif action == 2:
            if self._call("SetFMUstate", component, self.random.choice(self.states) if self.states else None) == OK:
                assert component is not None
                reached = self._reached(component)
                if reached is not None:
                    self.times[component] = reached
        elif action == 3 and self.states:
            state = self.states.pop()
            if self._call("FreeFMUstate", component, byref(state)) != OK:
                self.states.append(state)
        elif action == 4:
            self._serialise(component)
        elif len(self.states) < 10:
            self._deserialise(component)

    def _serialise(self, component: int | None) -> None:
        state = self.random.choice(self.states) if self.states else None
        size = c_size_t()
        if self._call("SerializedFMUstateSize", component, state, byref(size)) == OK:
            block = ctypes.create_string_buffer(size.value)
            room = size.value if self.random.random() < 0.8 else self.random.randrange(size.value)
            if self._call("SerializeFMUstate", component, state, block, room) == OK:
                self.blocks = [*self.blocks[-5:], block.raw]

    def _deserialise(self, component: int | None) -> None:
        block = bytearray(self.random.choice(self.blocks))
        odd = self.random.random()
        if odd < 0.2:
            del block[self.random.randrange(len(block) + 1) :]
        elif odd < 0.7 and block:
            for _ in range(self.random.choice([1, 1, 8])):
                block[self.random.randrange(len(block))] ^= 1 << self.random.randrange(8)
            if self.random.random() < 0.7:
                repair_checksum(block)
        state = c_void_p()
        if self._call("DeSerializeFMUstate", component, bytes(block), len(block), byref(state)) == OK:
            self.states.append(state)

    def _plain(self) -> None:
        name = self.random.choice(
            ["EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset", "CancelStep", "SetDebugLogging"]
        )
        component = self._component()
        if name != "SetDebugLogging":
            self._call(name, component)
            return
        names = [b"logAll", b"logStatusError", b"other", None]
        self._call(name, component, self.random.randint(0, 1), 4, self.random.choice([None, (c_char_p * 4)(*names)]))
        self._call(name, component, 1, 0, None)

    def _status(self) -> None:
        kind = self.random.randint(-1, 5)
        for name, value in (("", c_int()), ("Real", c_double()), ("Integer", c_int()), ("Boolean", c_int())):
            self._call(f"Get{name}Status", self._component(), kind, self.random.choice([None, byref(value)]))
        self._call("GetStringStatus", self._component(), kind, byref(c_char_p()))
        self._call("SetRealInputDerivatives", self._component(), None, 1, None, None)
        self._call("GetRealOutputDerivatives", self._component(), None, 1, None, None)
        self._call("GetDirectionalDerivative", self._component(), None, 1, None, 1, None, None)


def main(kind: Callable[..., Fuzzer] = Fuzzer, library: Callable[[Path, Path], Any] = Library) -> None:
    """Run a fuzzer from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", type=Path)
    parser.add_argument("description", type=Path)
    parser.add_argument("resources")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    fuzzer = kind(library(arguments.library, arguments.description), arguments.resources, arguments.seed)
    fuzzer.run(arguments.seconds)
    counts = f"{fuzzer.calls} calls, {fuzzer.refused} refused, {fuzzer.steps} steps"
    sys.stdout.write(f"{counts}, no finding (seed {arguments.seed})\n")


if __name__ == "__main__":
    main()
