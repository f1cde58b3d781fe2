"""Mutated tables of an FMU whose library serves all FMUs of its kind.

Run as a program: ``python tests/support/fuzz_tables.py LIBRARY MODEL_DESCRIPTION TABLE FOLDER --n 100000``, where
FOLDER is for the mutated files. A finding is a crash, a sanitizer's report, a refusal without a message, a memory block
that was not given back, or a table that was changed without its checksum and not refused.
"""

from __future__ import annotations

import argparse
import random
import struct
import zlib
from pathlib import Path

from fmi2_library import ERROR, OK, Library

NUMBERS = (0.0, -0.0, 1.0, -1.0, 2.0, 0.5, 1e-300, 1e300, -1e300, 1e5, 1e9, float("nan"), float("inf"), -float("inf"))
STEPS = 12


class Fuzzer:
    """Instances of one library, each with a table of its own."""

    def __init__(self, library: Library, table: bytes, folder: Path, seed: int) -> None:
        self.library, self.table, self.folder = library, table, folder
        self.random = random.Random(seed)
        self.refused = self.run = 0

    def once(self) -> None:
        """Instantiate with a mutated table; where it is taken, initialise and step."""
        whole = self.random.random() < 0.7
        table = self._repaired(self._mutated()) if whole else self._mutated()
        (self.folder / "variables.bin").write_bytes(table)
        self.library.messages.clear()
        component = self.library.instantiate(resources=self.folder.as_uri())
        if component is None:
            self.refused += 1
            assert any(status == ERROR for status, _, _ in self.library.messages), "refused without a message"
        else:
            assert whole or table == self.table, "a damaged table was taken"
            self._simulate(component)
            self.library.FreeInstance(component)
        assert not self.library.blocks, f"{len(self.library.blocks)} blocks of memory were not given back"

    def _simulate(self, component: int) -> None:
        if (
            self.library.EnterInitializationMode(component) != OK
            or self.library.ExitInitializationMode(component) != OK
        ):
            return
        self.run += 1
        for k in range(STEPS):
            for name, causality in self.library.causalities.items():
                if causality == "input":
                    self.library.set(component, name, self.random.gauss(0, 1e-2))
            if self.library.DoStep(component, k * 1e-3, 1e-3, 1) != OK:
                return
        for name, causality in self.library.causalities.items():
            if causality == "output":
                self.library.get(component, name)

    def _mutated(self) -> bytes:
        table = bytearray(self.table)
        for _ in range(self.random.choice([1, 1, 1, 2, 5])):
            what = self.random.random()
            if what < 0.3:
                table[self.random.randrange(len(table))] ^= 1 << self.random.randrange(8)
            elif what < 0.6:
                struct.pack_into("<d", table, 8 * self.random.randrange(len(table) // 8), self.random.choice(NUMBERS))
            elif what < 0.8:
                number = self.random.choice([0, 1, 2, 7, 2**31, 2**61, 2**64 - 1, self.random.getrandbits(64)])
                struct.pack_into("<Q", table, 8 * self.random.randrange(5), number)
            elif what < 0.9:
                del table[self.random.randrange(len(table)) :]
                table += bytes(max(0, 48 - len(table)))
            else:
                table += self.random.randbytes(8 * self.random.choice([1, 4, 4, 8, 400]))
        return bytes(table)

    def _repaired(self, table: bytes) -> bytes:
        """Return a table whose size and checksum fit, and mostly its number of modes."""
        body = bytearray(table[:-8])
        if len(body) < 16:
            return table
        struct.pack_into("<Q", body, 8, len(table))
        if len(body) > 32 and self.random.random() < 0.7:
            (modes,) = struct.unpack_from("<Q", self.table, 24)
            more = (len(table) - len(self.table)) // 32
            struct.pack_into("<Q", body, 24, max(0, modes + more))
        return bytes(body) + struct.pack("<Q", zlib.crc32(bytes(body)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", type=Path)
    parser.add_argument("description", type=Path)
    parser.add_argument("table", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--n", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    library = Library(arguments.library, arguments.description, largest=1 << 22)
    fuzzer = Fuzzer(library, arguments.table.read_bytes(), arguments.folder, arguments.seed)
    for _ in range(arguments.n):
        fuzzer.once()
    print(f"no finding: {arguments.n} tables, {fuzzer.refused} refused, {fuzzer.run} simulated")


if __name__ == "__main__":
    main()
