"""Binaries for other platforms against x86-64 Linux, under Wine and qemu where installed; of nights and releases.

Each FMU's reference run is played by tests/c/host.c; FMUs and host are compiled by the ``ziglang`` wheel.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from c_compiler import FLAGS, FMI_HEADERS
from places import ROOT

from hybridsep import build_fmu, load_machine
from hybridsep.base.signals import Array
from hybridsep.fmi.compile import TARGETS
from hybridsep.fmi.reference import REFERENCE_FOLDER

pytestmark = [pytest.mark.nightly, pytest.mark.release]

MODELS = ("HybridPredictor", "SepCompensator", "FeedDrive", "ReferenceTrajectory")
HERE = "x86_64-linux"
SYSROOT = os.environ.get("QEMU_LD_PREFIX", "/usr/aarch64-linux-gnu")
RUNNERS = {
    HERE: ((), ""),
    "x86_64-windows": (("wine",), "wine wine64"),
    "aarch64-linux": (("qemu-aarch64", "-L", SYSROOT), "qemu-user libc6-arm64-cross"),
}
"""What a command begins with on a target, and Debian's packages of it."""

TOLERANCE = 1e-12  # m


@pytest.fixture(scope="module")
def play(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str, str], Array]]:
    """Return a function that gives the outputs of an FMU's reference run on a target, (n, n_outputs)."""
    out, machine = tmp_path_factory.mktemp("foreign"), load_machine("spring_mass_damper")
    wine = os.environ | {"WINEPREFIX": str(out / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    for model in MODELS:
        with zipfile.ZipFile(build_fmu(machine, model, out, targets=list(RUNNERS))) as archive:
            archive.extractall(out / model)

    def played(model: str, target: str) -> Array:
        host, folder = out / f"host-{target}.exe", out / model
        runner, absolute = RUNNERS[target][0], "Z:" if target.endswith("windows") else ""
        if not host.exists():
            zig = [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[target].triple, *FLAGS, "-O2"]
            libraries = ["-ldl"] if target.endswith("linux") else []
            source = ROOT / "tests" / "c" / "host.c"
            subprocess.run([*zig, f"-I{FMI_HEADERS}", str(source), "-o", str(host), *libraries], check=True)
        (library,) = (folder / "binaries" / TARGETS[target].folder).iterdir()
        described = fmpy.read_model_description(str(folder))
        references: dict[str, list[str]] = {
            causality: [
                str(v.valueReference) for v in described.modelVariables if v.causality == causality and v.type == "Real"
            ]
            for causality in ("input", "output")
        }
        given, signals = folder / REFERENCE_FOLDER / f"{model}_in.csv", folder / "signals.bin"
        rows = np.loadtxt(given, delimiter=",", skiprows=1)[:, 1:] if given.exists() else np.zeros((600, 1))
        rows.astype("<f8").tofile(signals)
        uri = f"file:///{absolute}{folder / 'resources'}".replace("////", "///")
        command = [
            *runner,
            str(host),
            f"{absolute}{library}",
            described.guid,
            uri,
            "1e-3",
            str(len(references["input"])),
        ]
        command += [*references["input"], *references["output"], f"{absolute}{signals}"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=900, env=wine)
        assert done.returncode == 0, done.stderr
        return np.array([[float.fromhex(number) for number in line.split()] for line in done.stdout.splitlines()])

    yield played
    if (out / "wine").exists():
        subprocess.run(["wineserver", "-k"], env=wine, check=False, capture_output=True)


@pytest.mark.slow
@pytest.mark.skipif(
    (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="the comparison starts from x86-64 Linux"
)
@pytest.mark.parametrize("target", [target for target in RUNNERS if target != HERE])
def test_outputs_are_those_of_linux(play: Callable[[str, str], Array], target: str) -> None:
    runner, packages = RUNNERS[target]
    if not shutil.which(runner[0]) or ("-L" in runner and not Path(SYSROOT, "lib", "ld-linux-aarch64.so.1").exists()):
        pytest.skip(f"needs apt-get install {packages}")
    for model in MODELS:
        here, there = play(model, HERE), play(model, target)
        assert len(here) >= 600
        assert np.ptp(here, axis=0).max() > 1e-3  # it moves
        np.testing.assert_allclose(there, here, rtol=0, atol=TOLERANCE, err_msg=model)
