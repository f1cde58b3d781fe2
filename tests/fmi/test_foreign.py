"""Binaries for other platforms against x86-64 Linux, under Wine, qemu and musl's loader; of nights and releases.

Each FMU's reference run is played by tests/c/host.c. musl's loader takes the library for glibc, as on Alpine.
"""

import os
import platform
import shutil
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import fmpy
import numpy as np
import pytest
from c_compiler import FLAGS, FMI_HEADERS, zig
from places import ROOT
from programs import output_of

from hybridsep import build_fmu, load_machine
from hybridsep.base.signals import Array
from hybridsep.fmi.compile import TARGETS
from hybridsep.fmi.reference import REFERENCE_FOLDER

pytestmark = [pytest.mark.nightly, pytest.mark.release]

MODELS = ("HybridPredictor", "SepCompensator", "FeedDrive", "ReferenceTrajectory")
HERE = "x86_64-linux"
SYSROOT = os.environ.get("QEMU_LD_PREFIX", "/usr/aarch64-linux-gnu")


class Runner(NamedTuple):
    """What a target's host is run by, Debian's packages of it, and the host's platform in zig's words."""

    target: str
    command: tuple[str, ...]
    packages: str
    triple: str


RUNNERS = {
    "Linux": Runner(HERE, (), "", TARGETS[HERE].triple),
    "Windows": Runner("x86_64-windows", ("wine",), "wine wine64", TARGETS["x86_64-windows"].triple),
    "ARM": Runner(
        "aarch64-linux", ("qemu-aarch64", "-L", SYSROOT), "qemu-user libc6-arm64-cross", TARGETS["aarch64-linux"].triple
    ),
    "musl": Runner(HERE, ("/lib/ld-musl-x86_64.so.1",), "musl", "x86_64-linux-musl"),
}

TOLERANCE = 1e-12  # m


@pytest.fixture(scope="module")
def play(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str, str], Array]]:
    """Return a function that gives the outputs of an FMU's reference run on a platform, (n, n_outputs)."""
    out, machine = tmp_path_factory.mktemp("foreign"), load_machine("spring_mass_damper")
    wine = os.environ | {"WINEPREFIX": str(out / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    for model in MODELS:
        with zipfile.ZipFile(
            build_fmu(machine, model, out, targets=sorted({one.target for one in RUNNERS.values()}))
        ) as archive:
            archive.extractall(out / model)

    def played(model: str, platform: str) -> Array:
        host, folder = out / f"host-{platform}.exe", out / model
        target, runner, _, triple = RUNNERS[platform]
        absolute = "Z:" if platform == "Windows" else ""
        if not host.exists():
            compiler = zig("-target", triple, "-fno-sanitize=all", "-dynamic", *FLAGS, "-O2")
            libraries = ["-ldl"] if target.endswith("linux") else []
            source = ROOT / "tests" / "c" / "host.c"
            subprocess.run([*compiler, f"-I{FMI_HEADERS}", str(source), "-o", str(host), *libraries], check=True)
        (library,) = (folder / "binaries" / TARGETS[target].folder).iterdir()
        described = fmpy.read_model_description(str(folder))
        inputs, outputs = (
            [v.valueReference for v in described.modelVariables if v.causality == causality and v.type == "Real"]
            for causality in ("input", "output")
        )
        given, signals = folder / REFERENCE_FOLDER / f"{model}_in.csv", folder / "signals.bin"
        rows = np.loadtxt(given, delimiter=",", skiprows=1)[:, 1:] if given.exists() else np.zeros((600, 1))
        rows.astype("<f8").tofile(signals)
        uri = f"file:///{absolute}{folder / 'resources'}".replace("////", "///")
        given_to_host = [f"{absolute}{library}", described.guid, uri, "1e-3", len(inputs), *inputs, *outputs]
        printed = output_of(*runner, host, *given_to_host, f"{absolute}{signals}", timeout=900, env=wine)
        return np.array([[float.fromhex(number) for number in line.split()] for line in printed.splitlines()])

    yield played
    if (out / "wine").exists():
        subprocess.run(["wineserver", "-k"], env=wine, check=False, capture_output=True)


@pytest.mark.slow
@pytest.mark.skipif(
    (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="the comparison starts from x86-64 Linux"
)
@pytest.mark.parametrize("name", [name for name in RUNNERS if name != "Linux"])
def test_outputs_are_those_of_linux(play: Callable[[str, str], Array], name: str) -> None:
    runner = RUNNERS[name]
    needed = [runner.command[0], *([f"{SYSROOT}/lib/ld-linux-aarch64.so.1"] if name == "ARM" else [])]
    if not all(shutil.which(one) or Path(one).exists() for one in needed):
        pytest.skip(f"needs apt-get install {runner.packages}")
    for model in MODELS:
        here, there = play(model, "Linux"), play(model, name)
        assert len(here) >= 500
        assert np.ptp(here, axis=0).max() > 1e-3  # it moves
        np.testing.assert_allclose(there, here, rtol=0, atol=TOLERANCE, err_msg=model)
