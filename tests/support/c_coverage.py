"""What the tests reach of the C sources, counted by gcc: ``pytest --c-coverage FOLDER``.

The C core's test libraries and programs and the native FMUs' libraries of this machine are compiled with counters, by a
wrapper of gcc 11 or newer that gives each compilation a folder of its own below FOLDER; afterwards gcov's counts are
added up over all of them, line by line. Processes that are killed write no counts.
"""

import gzip
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from c_compiler import C_SOURCES

_WRAPPER = """#!/bin/sh
for argument in "$@"; do
    case $argument in --version | -print* | -M* | -E) exec gcc "$@" ;; esac
done
exec gcc "$@" -O0 --coverage -fprofile-update=atomic -Wno-missing-profile -dumpdir "$(mktemp -d '{folder}/XXXXXXXX')/"
"""


def count_in(folder: Path) -> None:
    """Let all that this process and its children compile for this machine count in a folder, which must be new."""
    from hybridsep.fmi import compile as compiling
    from hybridsep.fmi.c_header import KINDS
    from hybridsep.fmi.compile import ZIG, host_target

    folder.mkdir(parents=True)
    wrapper = folder.absolute() / "gcc"
    wrapper.write_text(_WRAPPER.replace("{folder}", str(folder.absolute())))
    wrapper.chmod(0o755)
    os.environ["CC"] = str(wrapper)
    kept = folder.absolute() / "libraries"
    if compiling._cache().is_dir():
        shutil.copytree(compiling._cache(), kept)
    os.environ["HYBRIDSEP_LIBRARIES"] = str(kept)
    for kind in KINDS:
        library = compiling._place(ZIG, (kind, host_target()))
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as place:
            for name, content in compiling._sources(kind).items():
                (Path(place) / name).write_bytes(content)
            flags = ["-std=c99", "-ffp-contract=off", "-fvisibility=hidden", "-D_GNU_SOURCE", "-fPIC", "-shared", "-I."]
            subprocess.run([wrapper, *flags, "all.c", "-o", library, "-lm"], cwd=place, check=True)


def table(folder: Path) -> str:
    """Return how many lines there are and which were not reached, by file, as text."""
    lines: dict[str, dict[int, int]] = {}
    ours = {path.name for path in C_SOURCES.rglob("*.[ch]")}
    for report in _reports(folder):
        for file in report["files"]:
            name = Path(file["file"]).name
            if name in ours:
                counted = lines.setdefault(name, {})
                for line in file["lines"]:
                    counted[line["line_number"]] = counted.get(line["line_number"], 0) + line["count"]
    missed = {name: [n for n, count in sorted(counted.items()) if not count] for name, counted in sorted(lines.items())}
    rows = [f"{name:36}{len(lines[name]):8}  {', '.join(map(str, numbers))}" for name, numbers in missed.items()]
    total, reached = (sum(map(len, of.values())) for of in (lines, missed))
    return "\n".join([*rows, f"{total} lines, {100 - 100 * reached / max(total, 1):.2f} % reached"])


def _reports(folder: Path) -> Iterator[dict[str, Any]]:
    for counts in folder.glob("*/*.gcda"):
        done = subprocess.run(
            ["gcov", "--json-format", "--stdout", counts], cwd=counts.parent, capture_output=True, check=False
        )
        if done.returncode == 0:
            text = gzip.decompress(done.stdout) if done.stdout[:2] == b"\x1f\x8b" else done.stdout
            for line in text.splitlines():
                yield json.loads(line)
