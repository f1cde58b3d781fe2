"""Files built once in a test session, by whichever of xdist's workers asks first."""

import hashlib
import os
import shutil
import time
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from c_compiler import build_folder

from hybridsep import build_fmu, fmu_names, load_machine, machine_names
from hybridsep.fmi.flavours import FLAVOURS
from hybridsep.fmi.reference import _SAMPLES_MAX
from hybridsep.machines.machine import Machine

_FMUS = {
    name: (machine, flavour, fmi)
    for machine in map(load_machine, machine_names())
    for flavour, fmi in (*((flavour, "2") for flavour in FLAVOURS), ("native", "3"))
    for name in fmu_names(machine, flavour, fmi)
}

NATIVE = [name for name, (_, flavour, fmi) in _FMUS.items() if (flavour, fmi) == ("native", "2")]
PYTHON = [name for name, (_, flavour, _) in _FMUS.items() if flavour == "python"]
FMI3 = [name for name, (_, _, fmi) in _FMUS.items() if fmi == "3"]
"""Names of all FMUs of all machines, the native ones by their version of FMI."""


def each_kind(values: Sequence[str] | Sequence[tuple[str, ...]]) -> list[Any]:
    """Return names of FMUs, or tuples that end in one, as pytest parameters; some machines' run at night."""
    # The stage's Y drive differs from its X drive only in numbers, and the rotary machine from the default one
    rows = [(value,) if isinstance(value, str) else value for value in values]
    return [pytest.param(*row, marks=_AT_NIGHT if row[-1].endswith(("_als25010_y", "_emps")) else []) for row in rows]


_AT_NIGHT = [pytest.mark.nightly]


SHARED_BUILDS = "HYBRIDSEP_TESTS_BUILDS"
"""Environment variable: folder of what the processes of a test session build once for all of them."""


def shared_builds() -> Path:
    """Return that folder, of only this process where there is no session."""
    return Path(os.environ.get(SHARED_BUILDS) or build_folder())


def built_once(path: Path, build: Callable[[Path], object]) -> Path:
    """Return ``path``, which ``build`` makes, given a name beside it; other processes wait meanwhile."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lock, unfinished = path.with_name(f"{path.name}.lock"), path.with_name(f"{path.name}.unfinished")
    while not path.exists():
        try:
            lock.mkdir()
        except FileExistsError:
            time.sleep(0.05)
            continue
        try:
            if not path.exists():
                shutil.rmtree(unfinished, ignore_errors=True)  # of a build that failed: the next test says why, too
                build(unfinished)
                os.replace(unfinished, path)  # noqa: PTH105 - a folder as well as a file
        finally:
            lock.rmdir()
    return path


def content(path: Path) -> dict[str, bytes]:
    """Return the files of an archive by name."""
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def changed(archive: Path, target: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """Copy an archive, each file as ``change`` gives it, without those for which it gives None."""
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = change(name, old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


class BuiltFmus:
    """The FMUs of all machines in both flavours, for this machine; ``folder``: shared by a session's workers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __call__(self, name: str, *, machine: Machine | None = None, weights: Path | None = None) -> Path:
        """Return an FMU's archive, built when it is first asked for.

        ``name``: of :func:`hybridsep.fmu_names`; ``machine``: with other values than the machine file of that name
        has; ``weights``: saved predictor that it starts warm with.
        """
        own, flavour, fmi = _FMUS[name]
        machine = machine or own
        content = repr(machine.table).encode() + (weights.read_bytes() if weights else b"")
        folder = self.folder / hashlib.sha256(content).hexdigest()[:16]
        targets = ("host",) if flavour == "native" else None

        def build(unfinished: Path) -> None:
            folder = unfinished.with_suffix(".d")
            with pytest.MonkeyPatch.context() as patch:  # a reference as users get it, whatever the test has
                patch.setattr("hybridsep.fmi.reference._SAMPLES_MAX", _SAMPLES_MAX)
                made = build_fmu(machine, name, folder, flavour, targets=targets, weights=weights, fmi=fmi)
            os.replace(made, unfinished)  # noqa: PTH105

        return built_once(folder / f"{name}.fmu", build)
