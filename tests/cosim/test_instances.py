"""A thousand native HybridPredictors in one process: memory of each, isolation, no leaks."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from ctypes import c_double, c_uint
from pathlib import Path

import numpy as np
import pytest
from fmi2_library import OK, Library
from numpy.typing import NDArray
from places import SUPPORT

from hybridsep import paper_machine
from hybridsep.fmi.spec import table_of

N_INSTANCES = 1000
N_SAMPLES = 350  # the hybrid predicts from sample 200 on, if t_init is 0
TS = 1e-3
OVERHEAD = 1.2  # at most, of the arrays


@pytest.fixture
def folder(folders: Callable[[str], Path]) -> Path:
    """The unpacked HybridPredictor with the paper's parameters, built for this machine."""
    return folders("HybridPredictor")


@pytest.fixture
def fmu(folder: Path) -> Library:
    return library_of(folder)


def library_of(folder: Path) -> Library:
    """Return the functions of the one library in the unpacked FMU that this machine can load."""
    suffix = {"Windows": "dll", "Darwin": "dylib"}.get(platform.system(), "so")
    return Library(next((folder / "binaries").rglob(f"*.{suffix}")), folder / "modelDescription.xml")


def array_bytes() -> int:
    """Return the size of the arrays that eqs. (2) to (6) need, counted from the paper's parameters, not from the code.

    ``n = 2 + p + q`` features; the upper triangle of the factor of ``[phi | target]``, each entry with what rounding
    took from it; five windows; the past of ``x_pb`` and ``e_pb`` behind a window; the weights, and the weights of
    ``e_pb`` once more in the order of their use; for the uncertainty two windows and one of each of its seven
    components; per mode a matrix, two vectors, the feed-through and the state; and one number for each FMI variable.
    """
    machine = paper_machine("spring_mass_damper")
    values = machine.fmi_parameters()
    Np, p, q = (int(values[name]) for name in ("Np", "p", "q"))
    n = 2 + p + q
    factor = (n + 1) * (n + 2) + 2 * (n + 1)  # twice the triangle; the scales and the incoming row
    windows = (5 + 2 + 7) * Np + (Np + q) + (Np + p) + n + p
    table = table_of(machine, "HybridPredictor", "HybridPredictor")
    return 8 * (factor + windows + 11 * len(table.modes) + len(table.variables))


def signals(i: int) -> NDArray[np.float64]:
    """Return ``x_d_ahead`` and ``x_meas`` of instance ``i``, ``(N_SAMPLES, 2)``: its own motion and noise."""
    rng = np.random.default_rng(i)
    k = np.arange(N_SAMPLES)
    amplitude, frequency, phase = rng.uniform(1e-3, 1e-2), rng.uniform(0.01, 0.05), rng.uniform(0, 6)
    x_d = amplitude * np.sin(frequency * k + phase)
    x = amplitude * np.sin(frequency * (k - 105) + phase) + rng.normal(0, 5e-6, N_SAMPLES)
    return np.column_stack((x_d, x))


def started(fmu: Library, name: bytes, start: float, *, bare: bool = False) -> int:
    """Return a new component that rests at ``start`` and predicts as soon as it has learned."""
    component = fmu.instantiate_bare() if bare else fmu.instantiate(name)
    assert component is not None
    assert fmu.set(component, "averaging", 0) == OK
    assert fmu.set(component, "t_init", 0.0) == OK
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.set(component, "x_d_ahead", start) == OK
    assert fmu.ExitInitializationMode(component) == OK
    return component


def sample(fmu: Library, component: int, k: int, inputs: NDArray[np.float64]) -> None:
    """Bring sample ``k``, ``inputs`` being its row of :func:`signals`."""
    references = (c_uint * 2)(fmu.references["x_d_ahead"], fmu.references["x_meas"])
    assert fmu.SetReal(component, references, 2, (c_double * 2)(*inputs)) == OK
    assert fmu.DoStep(component, k * TS, TS, 1) == OK


def resident() -> int:
    """Return the bytes of this process that are in memory, on Linux."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def measure(folder: str) -> None:
    """Print what instances take in a process of their own, all of them stepped, and what cycles leave behind."""
    fmu = library_of(Path(folder))
    inputs = signals(0)
    started(fmu, b"", inputs[0, 0], bare=True)  # loads what is loaded once
    before = resident()
    components = [started(fmu, b"", inputs[0, 0], bare=True) for _ in range(N_INSTANCES)]
    for component in components:
        for k in range(2):
            sample(fmu, component, k, inputs[k])
    per_instance = (resident() - before) / N_INSTANCES
    for component in components:
        fmu.FreeInstance(component)
    before = resident()
    for _ in range(2 * N_INSTANCES):
        component = started(fmu, b"", inputs[0, 0], bare=True)
        sample(fmu, component, 0, inputs[0])
        fmu.restore(component, fmu.save(component))
        assert fmu.Reset(component) == OK
        fmu.FreeInstance(component)
    print(json.dumps({"per_instance": per_instance, "left": resident() - before}))


@pytest.mark.slow
@pytest.mark.skipif(platform.system() != "Linux", reason="resident memory is read from /proc, which is Linux's")
def test_memory_is_that_of_the_arrays_and_cycles_leave_none(
    folder: Path, record_property: Callable[[str, object], None]
) -> None:
    script = f"import sys; sys.path[:0] = {[str(Path(__file__).parent), str(SUPPORT)]!r}\n"
    script += f"import test_instances; test_instances.measure({str(folder)!r})"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    measured = json.loads(result.stdout)
    print(f"{measured['per_instance']:.0f} bytes resident per instance, {array_bytes()} of them arrays")
    record_property("bytes_per_instance", measured["per_instance"])
    assert 0.9 * array_bytes() < measured["per_instance"] < OVERHEAD * array_bytes()
    assert measured["left"] < 4 * array_bytes()  # of 2000 cycles, each with a save, a restore and a reset


@pytest.mark.slow
def test_an_instance_asks_for_little_more_than_its_arrays(fmu: Library) -> None:
    """Allocated bytes of an instance, all of them freed with it."""
    component = started(fmu, b"an instance", 0.0)
    assert array_bytes() < sum(fmu.blocks.values()) < OVERHEAD * array_bytes()
    allocations = fmu.allocations
    for k, inputs in enumerate(signals(1)[:250]):
        sample(fmu, component, k, inputs)
    assert fmu.allocations == allocations
    fmu.FreeInstance(component)
    assert not fmu.blocks


@pytest.mark.slow
@pytest.mark.parametrize("n", [50, pytest.param(N_INSTANCES, marks=pytest.mark.nightly)])
def test_no_instance_sees_another(fmu: Library, n: int) -> None:
    """Many, each with a motion of its own, sample by sample in turn, end where each ends when it is alone."""
    inputs = np.stack([signals(i) for i in range(n)])
    together = [started(fmu, f"instance {i}".encode(), inputs[i, 0, 0]) for i in range(n)]
    for k in range(N_SAMPLES):
        for i, component in enumerate(together):
            sample(fmu, component, k, inputs[i, k])
    assert fmu.get(together[0], "hybrid_active")
    ends = [(fmu.save(component), fmu.reals(component)) for component in together]
    assert len(set(ends)) == n
    for component in together:
        fmu.FreeInstance(component)
    assert not fmu.blocks
    for i in range(n):
        alone = started(fmu, b"alone", inputs[i, 0, 0])
        for k in range(N_SAMPLES):
            sample(fmu, alone, k, inputs[i, k])
        assert (fmu.save(alone), fmu.reals(alone)) == ends[i], f"instance {i}"
        fmu.FreeInstance(alone)
    assert not fmu.blocks
