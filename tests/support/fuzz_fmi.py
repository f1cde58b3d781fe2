"""Random calls of an FMU's functions of FMI 2.0 or 3.0, and tables that were changed.

Run as a program: ``python tests/support/fuzz_fmi.py FOLDER --seconds 600 --seed 1``, with unpacked FMUs, best ones
with sanitizers and counted blocks (``-include tests/c/counted.h``). Findings: a crash, a refusal without
a message, a refused step that changed a value, a damaged table that was taken, memory that was not given back.
"""

import argparse
import random
import shutil
import struct
import tempfile
import time
import zlib
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer
from itertools import zip_longest
from pathlib import Path
from typing import Any

from fmi_library import ABSENT, DISCARD, ERROR, OK, library_of

NUMBERS = [0.0, 1e-3, -1e-3, 1.0, 1e300, -1e300, 5e-324, float("nan"), float("inf"), -float("inf")]
WHOLE = [0, 1, -1, 50, 2**31 - 1, -(2**31)]
RANGES = {
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
"""What a parameter is set to mostly."""
CASES: list[dict[str, float]] = [
    {"averaging": 0, "input_hold": 1, "t_init": 0.0},
    {"averaging": 0, "Np": 1, "p": 1, "q": 0, "spacing": 1},
    {"averaging": 0, "p": 50, "q": 49, "lambda": 1e-20},
    {"averaging": 0, "Np": 12, "p": 7, "q": 5, "spacing": 3, "preview": 77, "dead_time": 13, "t_init": 0.0},
    {"averaging": 0, "spacing": 50, "preview": 303, "compensate": 1},
    {"Np": 7, "p": 7, "q": 6, "spacing": 1, "preview": 60},
    {"Np": 150, "p": 2, "q": 0, "dead_time": 13, "preview": 300},
    {"Np": 50, "p": 20, "v_max": 0.08, "a_max": 8.0, "j_max": 1000.0},
    {"Np": 12, "p": 7, "q": 2, "spacing": 3, "preview": 77, "measurement_delay": 7, "t_init": 0.0},
]
"""What parameters are set to in runs before; FMUs without most of them have one."""


class Fuzzer:
    """Calls at random, on up to three instances, of which about half are what an importer would do."""

    def __init__(self, folder: Path, scratch: Path, seed: int) -> None:
        self.library, self.resources, self.scratch = library_of(folder), folder / "resources", scratch
        self.is_3 = self.library.version == 3
        self.random = random.Random(seed)
        self.instances: list[int] = []
        self.states: list[c_void_p] = []
        self.blocks: list[bytes] = [b""]
        self.times: dict[int, float] = {}
        self.table = (self.resources / "variables.bin").read_bytes()
        self.calls = self.refused = self.steps = 0

    def run(self, seconds: float) -> None:
        """Call until the time is over, then free everything and look for lost blocks."""
        instance = self.library.instantiate()
        if not self.library.blocks:
            raise AssertionError("the library does not count its blocks: compile it with tests/c/counted.h")
        self.library.FreeInstance(instance)
        for case in CASES if "Np" in self.library.references else [{}]:
            self._whole_run({name: value for name, value in case.items() if name in self.library.references})
        end = time.monotonic() + seconds
        calls = (self._instantiate, self._free, self._initialise, self._steps, self._access)
        weights = (6, 2, 8, 40, 20, 12, 10, 2)
        while time.monotonic() < end:
            self.random.choices((*calls, self._state, self._plain, self._status), weights)[0]()
            self.library.messages.clear()
        while self.instances:
            self._free()
        if self.library.blocks:
            raise AssertionError(f"{len(self.library.blocks)} blocks of memory were not given back")

    def _whole_run(self, case: dict[str, float]) -> None:
        self.library.messages.clear()
        instance = self.library.instantiate(resources=self._place(self.resources))
        statuses = {self.library.set(instance, name, value) for name, value in case.items()}
        statuses |= {self.library.begin(instance), self.library.ExitInitializationMode(instance)}
        for k in range(2 * int(case.get("Np", 50)) + 20):
            for name in self._inputs:
                value = self.random.gauss(0, 1e-2) if self.library.kinds[name] == self.library.real else 0
                statuses.add(self.library.set(instance, name, value))
            statuses.add(self.library.do_step(instance, 1e-3 * k, 1e-3))
        if statuses != {OK}:
            raise AssertionError(f"a run with {case} was refused: {self.library.messages[:1]}")
        self.library.FreeInstance(instance)

    @property
    def _inputs(self) -> list[str]:
        return [name for name, causality in self.library.causalities.items() if causality == "input"]

    def _check(self, name: str, instance: int | None, status: int) -> int:
        self.calls += 1
        self.refused += status == ERROR
        if status not in (OK, DISCARD, ERROR):
            raise AssertionError(f"{name} returned {status}")
        if status == ERROR and instance is not None and not self.library.messages:
            raise AssertionError(f"{name} was refused without a message")
        return status

    def _call(self, name: str, instance: int | None, *arguments: Any) -> int:
        self.library.messages.clear()
        return self._check(name, instance, getattr(self.library, name)(instance, *arguments))

    def _instance(self) -> int | None:
        return self.random.choice(self.instances) if self.instances and self.random.random() < 0.98 else None

    def _number(self) -> float:
        return self.random.choice([*NUMBERS, self.random.gauss(0, 1)])

    def _chance(self, share: float) -> bool:
        return self.random.random() < share

    def _place(self, folder: Path) -> str:
        return f"{folder}/" if self.is_3 else folder.as_uri()

    def _instantiate(self) -> None:
        if len(self.instances) == 3:
            self._free()
            return
        odd, own = self._chance(0.2), self._place(self.resources)
        more: dict[str, Any] = {"kind": self.random.choice([0, 1, 7]) if odd else 1}
        if self.is_3:
            more = {"event_mode": odd and self._chance(0.3), "intermediate": self.random.choice([0, 3]) if odd else 0}
        intact = not self._chance(0.4)
        if not intact:
            own, intact = self._place(self.scratch), self._mutated_table()
        instance = self.library.instantiate(
            self.random.choice([None, b""]) if odd else b"i%d" % len(self.instances),
            guid="{}" if odd and self._chance(0.5) else None,
            resources=self.random.choice([None, "file://%00", "http://x/y", "file:", "%", *7 * [own]])
            if intact
            else own,
            logging_on=self._chance(0.5),
            **more,
        )
        if instance is not None:
            if not intact:
                raise AssertionError("a damaged table was taken")
            self.instances.append(instance)
            self.times[instance] = 0.0
        elif not self.library.messages:
            raise AssertionError("an instance was refused without a message")

    def _mutated_table(self) -> bool:
        """Write a changed table to the scratch folder; return whether it may be taken."""
        table = bytearray(self.table)
        for _ in range(self.random.choice([1, 1, 1, 2, 5])):
            kind, n = self.random.randrange(10), len(table) // 8
            if kind < 3:
                table[self.random.randrange(len(table))] ^= 1 << self.random.randrange(8)
            elif kind < 6:
                struct.pack_into("<d", table, 8 * self.random.randrange(n), self.random.choice([*NUMBERS, 1e5, 1e9]))
            elif kind < 8:
                counts = [0, 1, 2, 7, 2**31, 2**61, 2**64 - 1, self.random.randrange(2**64)]
                struct.pack_into("<Q", table, 8 * self.random.randrange(6), self.random.choice(counts))
            elif kind < 9:
                del table[max(104, self.random.randrange(len(table))) :]
            else:
                table += self.random.randbytes(self.random.choice([8, 32, 64, 3200]))
        whole = self._chance(0.7)
        if whole:
            struct.pack_into("<Q", table, 8, len(table))
            table[-8:] = struct.pack("<Q", zlib.crc32(table[:-8]))
        (self.scratch / "variables.bin").write_bytes(table)
        return whole or table == self.table

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
        instance, start = self._instance(), self.random.choice([0.0, 0.0, 12.5, self._number()])
        if self._chance(0.7):
            self._call("Reset", instance)
        self.library.messages.clear()
        stop = self._number() if self._chance(0.1) else None
        self._check("EnterInitializationMode", instance, self.library.begin(instance, start, stop))
        if instance is None:
            return
        for name, (low, high) in RANGES.items():
            if name in self.library.references and (name == "p" or self._chance(0.5)):
                value = self.random.randint(low, high) if self._chance(0.97) else self.random.choice([*WHOLE, 100_000])
                self.library.set(instance, name, value)
        for name in ("x_d_ahead", "x_d"):
            if self.library.causalities.get(name) == "input":
                self.library.set(instance, name, self.random.choice([0.0, 0.1, self._number()]))
        if self._call("ExitInitializationMode", instance) == OK:
            self.times[instance] = start

    def _reals(self, instance: int) -> bytes:
        """Return all Reals, bit by bit; none where they are refused, as outputs of an invalid start are."""
        try:
            return bytes(self.library.reals(instance))
        except RuntimeError:
            return b""

    def _steps(self) -> None:
        instance = self._instance()
        if instance is None:
            self.library.do_step(None, 0.0, 1e-3)
            return
        names = self._inputs
        for _ in range(self.random.randint(1, 100)):
            odd = self._chance(0.05)
            for name in names:
                value = self._number() if odd else self.random.gauss(0, 1e-2)
                self.library.set(instance, name, value)
            if "reset" in self.library.causalities and self._chance(0.2):
                self.library.set(instance, "reset", self._chance(0.5))
            t = self.times[instance]
            usual = self.random.choice([1e-3, 1e-3, 3e-4, 8e-3, self.random.uniform(0.0, 0.05)])
            h = self.random.choice([1e-7, 0.0, -1e-3, 1.3, self._number()]) if odd else usual
            if not self.is_3 and self._chance(0.1):
                n = len(names)
                references = (c_uint * n)(*(self.library.references[name] for name in names))
                orders = (c_int * n)(*(self.random.choice([0, 1, 2]) if odd else 1 for _ in names))
                slopes = (c_double * n)(*(self._number() if odd else self.random.gauss(0, 0.1) for _ in names))
                self._call("SetRealInputDerivatives", instance, references, n, orders, slopes)
            before, at = self._reals(instance), self._number() if self._chance(0.02) else t
            self.library.messages.clear()
            if self._check("DoStep", instance, self.library.do_step(instance, at, h)) == OK:
                self.times[instance] = t + h
                self.steps += 1
            elif before != self._reals(instance):
                raise AssertionError("a refused step changed a value")

    def _access(self) -> None:
        usual = ["Float64", "Float64", "Int32", "Int64", "Boolean"] if self.is_3 else ["Real"]
        kind = self.random.choice([*usual, *self.library.values])
        count, n = self.random.randint(0, 8), len(self.library.references)
        sizes = {self.library.references[name]: size for name, size in self.library.sizes.items()}
        last = [n - 1 - self.random.randrange(min(n, 6)), n, 2**32 - 1]
        places = [
            self.random.choice([self.random.randrange(n), self.random.randrange(30), *last]) for _ in range(count)
        ]
        n_values = sum(sizes.get(place, 1) for place in places)
        if self.is_3 and self._chance(0.1):
            n_values = max(n_values + self.random.choice([-1, 1]), 0)
        values = (self.library.values[kind] * n_values)()
        for i in range(n_values):
            if kind in ("Real", "Float32", "Float64"):
                values[i] = self._number()
            elif kind != "String":
                values[i] = self._chance(0.5) if kind == "Boolean" else self.random.choice([*WHOLE, 2**63 - 1])
        null, verb, instance = self.random.random(), self.random.choice(["Get", "Set"]), self._instance()
        given = None if null < 0.03 else (c_uint * count)(*places), count, None if null > 0.97 else values, n_values
        self.library.messages.clear()
        self._check(f"{verb}{kind}", instance, self.library.access(verb, kind, instance, *given))

    def _state(self) -> None:
        instance, action = self._instance(), self.random.randrange(6)
        some = self.random.choice(self.states) if self.states else None
        if action == 0 and len(self.states) < 10:
            state = c_void_p()
            if self._call("GetFMUstate", instance, byref(state)) == OK:
                self.states.append(state)
        elif action == 1:
            self._call("GetFMUstate", instance, None if some is None else byref(some))
        elif action == 2:
            if self._call("SetFMUstate", instance, some) == OK and instance is not None:
                reached = self.library.time(instance)
                self.times[instance] = self.times[instance] if reached is None else reached
        elif action == 3 and some is not None:
            if self._call("FreeFMUstate", instance, byref(some)) == OK:
                self.states.remove(some)
        elif action == 4:
            size = c_size_t()
            if self._call("SerializedFMUstateSize", instance, some, byref(size)) == OK:
                block = create_string_buffer(size.value)
                room = size.value if self._chance(0.8) else self.random.randrange(size.value)
                if self._call("SerializeFMUstate", instance, some, self.library.block(block), room) == OK:
                    self.blocks = [*self.blocks[-5:], block.raw]
        elif len(self.states) < 10:
            self._deserialise(instance)

    def _deserialise(self, instance: int | None) -> None:
        block, odd = bytearray(self.random.choice(self.blocks)), self.random.random()
        if odd < 0.2:
            del block[self.random.randrange(len(block) + 1) :]
        elif odd < 0.7 and block:
            for _ in range(self.random.choice([1, 1, 8])):
                block[self.random.randrange(len(block))] ^= 1 << self.random.randrange(8)
        state, given = c_void_p(), self.library.block(create_string_buffer(bytes(block), len(block) + 1))
        if self._call("DeSerializeFMUstate", instance, given, len(block), byref(state)) == OK:
            self.states.append(state)

    def _plain(self) -> None:
        instance = self._instance()
        name = self.random.choice(["ExitInitializationMode", "Terminate", "Reset", "SetDebugLogging"])
        if name != "SetDebugLogging":
            self._call(name, instance)
            return
        names = (c_char_p * 4)(b"logAll", b"logStatusError", b"other", None)
        self._call(name, instance, self._chance(0.5), 4, self.random.choice([None, names]))
        self._call(name, instance, True, 0, None)

    def _status(self) -> None:
        """Call what is absent, and FMI 2.0's functions of a status."""
        instance = self._instance()
        if self.is_3:
            for name in self.random.sample(ABSENT, 5):
                if self._call(name, instance) != ERROR:
                    raise AssertionError(f"{name} is absent, and was not refused")
            flags = [*(byref(c_bool()) for _ in range(3)), byref(c_double())]
            flags[self.random.randrange(4)] = None  # type: ignore[call-overload]
            self._call("DoStep", instance, self.times.get(instance or 0, 0.0), 1e-3, True, *flags)
            return
        kind = self.random.randint(-1, 5)
        for name, value in (("", c_int()), ("Real", c_double()), ("Integer", c_int()), ("Boolean", c_int())):
            self._call(f"Get{name}Status", instance, kind, self.random.choice([None, byref(value)]))
        self._call("GetStringStatus", instance, kind, byref(c_char_p()))
        self._call("CancelStep", instance)
        for name, n in (("SetRealInputDerivatives", 2), ("GetRealOutputDerivatives", 2)):
            self._call(name, instance, None, 1, *[None] * n)
        self._call("GetDirectionalDerivative", instance, None, 1, None, 1, None, None)


def main() -> None:
    """Run the fuzzer from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--seconds", type=float, nargs="+", default=[30.0], help="of each folder, the last one's again")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for folder, seconds in zip_longest(arguments.folders, arguments.seconds, fillvalue=arguments.seconds[-1]):
        print(f"{folder.name}: ", end="", flush=True)
        with tempfile.TemporaryDirectory() as place:
            scratch = shutil.copytree(folder / "resources", Path(place) / "resources")
            fuzzer = Fuzzer(folder.resolve(), scratch, arguments.seed)
            fuzzer.run(seconds)
        print(f"{fuzzer.calls} calls, {fuzzer.refused} refused, {fuzzer.steps} steps, no finding")


if __name__ == "__main__":
    main()
