"""Compare the native FMUs' outputs on other platforms with those on x86-64 Linux, over the staircase.

Run as a program: ``python tests/fmi/foreign/compare.py`` prints the largest deviation of each output on each platform
that can be run here: win64 under Wine, aarch64 under qemu-user. Both the FMUs and the C host that plays them
(``host.c``) are compiled by the ``ziglang`` wheel.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
from numpy.typing import NDArray

from hybridsep import Encoder, build_fmu, cosimulate, load_machine, simulate, staircase
from hybridsep.fmi.compile import TARGETS

Array = NDArray[np.float64]

HOST = Path(__file__).with_name("host.c")
HOST_FLAGS = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
SYSROOT = Path(os.environ.get("QEMU_LD_PREFIX", "/usr/aarch64-linux-gnu"))
NOISE = 5e-6  # m, of the encoder
TIME_LIMIT = 900  # s, for one run; Wine's first one makes its folders

INPUTS = {
    "HybridPredictor": ["x_d_ahead", "x_meas"],
    "SepCompensator": ["x_d_ahead", "x_meas"],
    "FeedDrive": ["x_d"],
    "ReferenceTrajectory": [],
}
OUTPUTS = {
    "HybridPredictor": ["x_d", "x_pb", "x_h", "rms_pb", "rms_h"],
    "SepCompensator": ["x_dm", "x_d", "x_pb", "x_h", "rms_e", "rms_pb", "rms_h"],
    "FeedDrive": ["x", "x_meas"],
    "ReferenceTrajectory": ["r"],
}
"""Outputs of each FMU that are compared: positions, m."""


@dataclass(frozen=True)
class Platform:
    """Runner of another platform's binaries.

    Attributes
    ----------
    target : str
        Key of :data:`hybridsep.fmi.compile.TARGETS`.
    runner : tuple of str
        What the command begins with; empty for this machine's own binaries.
    packages : str
        Debian's names of what the runner needs.
    """

    target: str
    runner: tuple[str, ...] = ()
    packages: str = ""

    @property
    def runs(self) -> bool:
        """Whether the runner is installed."""
        if not self.runner:
            return True
        complete = self.target != "aarch64-linux" or (SYSROOT / "lib" / "ld-linux-aarch64.so.1").exists()
        return shutil.which(self.runner[0]) is not None and complete

    @property
    def absolute(self) -> str:
        """Prefix of an absolute path there."""
        return "Z:" if self.runner and self.target.endswith("windows") else ""


HERE = Platform("x86_64-linux")
FOREIGN = {
    "win64": Platform("x86_64-windows", ("wine",), "wine wine64"),
    "aarch64": Platform("aarch64-linux", ("qemu-aarch64", "-L", str(SYSROOT)), "qemu-user libc6-arm64-cross"),
}


def build(out: Path, platforms: Iterable[Platform]) -> None:
    """Build and unpack the FMUs, and compile the host, for some platforms."""
    machine, targets = load_machine("spring_mass_damper"), [platform.target for platform in platforms]
    for model in OUTPUTS:
        with zipfile.ZipFile(build_fmu(machine, model, out, targets=targets)) as archive:
            archive.extractall(out / model)
    headers = Path(fmpy.__file__).parent / "c-code"
    for target in targets:
        zig = [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[target].triple]
        command = [*zig, *HOST_FLAGS, f"-I{headers}", str(HOST), "-o", str(out / _host_name(target))]
        subprocess.run([*command, "-ldl"] if target.endswith("linux") else command, check=True)


def _host_name(target: str) -> str:
    return f"host-{target}.exe"


def signals() -> dict[str, Array]:
    """Return what each FMU is given, a row a sample: the staircase, and a drive that follows it."""
    machine, r = load_machine("spring_mass_damper"), staircase()
    compensator = machine.new_compensator()
    compensated = cosimulate(compensator, machine.new_plant(), r, encoder=Encoder(NOISE, 0)).x_meas
    preview, Np = compensator.preview, machine.new_predictor().Np
    x_d = np.concatenate((np.full(Np, r[0]), r))
    x_meas = simulate(machine.new_plant(), x_d, machine.T_s)
    x_meas += np.random.default_rng(0).normal(0.0, NOISE, len(x_meas))
    return {
        "HybridPredictor": np.column_stack((_held(r, Np), x_meas)),
        "SepCompensator": np.column_stack((_held(r, preview), np.concatenate((np.full(preview, r[0]), compensated)))),
        "FeedDrive": x_d[:, None],
        "ReferenceTrajectory": _held(r, Np)[:, None],
    }


def _held(r: Array, n: int) -> Array:
    return np.concatenate((r, np.full(n, r[-1])))


def play(out: Path, model: str, platform: Platform, given: Array) -> Array:
    """Return the outputs of an FMU on a platform, ``(n_samples, n_outputs)``, m."""
    folder, target = out / model, TARGETS[platform.target]
    (library,) = (folder / "binaries" / target.folder).iterdir()
    description = ET.parse(folder / "modelDescription.xml").getroot()
    references = {str(v.get("name")): str(v.get("valueReference")) for v in description.iter("ScalarVariable")}
    given_file = folder / "signals.bin"
    given.astype("<f8").tofile(given_file)
    uri = f"file:///{platform.absolute}{folder / 'resources'}".replace("////", "///")
    command = [*platform.runner, str(out / _host_name(platform.target)), f"{platform.absolute}{library}"]
    command += [str(description.get("guid")), uri, "1e-3", str(len(INPUTS[model]))]
    command += [references[name] for name in (*INPUTS[model], *OUTPUTS[model])]
    command.append(f"{platform.absolute}{given_file}")
    result = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, env=_environment(out))
    if result.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}\n{result.stderr}")
    return np.array([[float.fromhex(number) for number in line.split()] for line in result.stdout.splitlines()])


def _environment(out: Path) -> Mapping[str, str]:
    """Return the environment, with Wine's folders beside the FMUs and without its chatter."""
    return os.environ | {"WINEPREFIX": str(out / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}


def end_wine(out: Path) -> None:
    """End the server that Wine has left running for these folders."""
    if (out / "wine").exists():
        subprocess.run(["wineserver", "-k"], env=_environment(out), check=False, capture_output=True)


def deviations(out: Path, platform: Platform) -> dict[str, float]:
    """Return the largest deviation of each output from x86-64 Linux, m, as ``model.output``; both are built."""
    largest: dict[str, float] = {}
    for model, given in signals().items():
        here, there = play(out, model, HERE, given), play(out, model, platform, given)
        assert here.shape == there.shape == (len(given), len(OUTPUTS[model]))
        assert np.ptp(here, axis=0).all()  # every output moves
        largest |= {f"{model}.{name}": d for name, d in zip(OUTPUTS[model], abs(there - here).max(axis=0), strict=True)}
    return largest


def main() -> None:
    """Print the deviations on every platform that can be run here."""
    runnable = {name: platform for name, platform in FOREIGN.items() if platform.runs}
    for name in sorted(set(FOREIGN) - set(runnable)):
        print(f"{name}: not run; install {FOREIGN[name].packages}")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        build(out, [HERE, *runnable.values()])
        try:
            for name, platform in runnable.items():
                for output, deviation in deviations(out, platform).items():
                    print(f"{name}: {output} deviates by at most {deviation:.1e} m")
        finally:
            end_wine(out)


if __name__ == "__main__":
    main()
