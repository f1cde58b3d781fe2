"""The C library on processors of controllers, emulated without an operating system, and in WebAssembly.

Libraries of mathematics differ in the last bit: what is compared to the bit has the same exp, pow, tanh, sin and cos
on both machines (benchmarks/targets/plain_math.c).
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from c_compiler import zig
from c_library import Library
from controllers import target_or_skip
from places import SUPPORT

from benchmarks.targets.cases import KINDS, Case, parameters, recorded
from benchmarks.targets.targets import TARGETS, Replay, Target, build, replay
from hybridsep.base.signals import Array

pytestmark = [pytest.mark.nightly, pytest.mark.slow]

WINDOWS = 40
WARM = {kind: Case(kind, 20, 20, WINDOWS, warm=True) for kind in KINDS}
AGREES = {"predictor": 1e-11, "compensator": 1e-9}  # difference that ARCHITECTURE.md allows, m


def played(target: str, case: Case, folder: Path, *, plain_math: bool = True, options: tuple[str, ...] = ()) -> Replay:
    machine = target_or_skip(target)
    return replay(machine, build(machine, case, folder, plain_math=plain_math, options=options), count=False)


def by_library(case: Case) -> Array:
    """Return the outputs of the C library as the other tests have it, (n, 2), m."""
    values, mode = parameters(case)
    library = Library(case.kind, values, [mode])
    samples, weights = recorded(case)
    assert library.begin(float(samples[0, 0]), weights or None) == 0
    outputs = []
    for x_d_ahead, x_meas in samples.tolist():
        found = library.sample(x_d_ahead, x_meas)
        predictor = (found.predicted.x_h, found.predicted.x_h_std)
        outputs.append(predictor if case.kind == "predictor" else (found.x_dm, found.predicted.x_h))
    return np.array(outputs)


@pytest.mark.parametrize("kind", KINDS)
def test_outputs_on_this_machine_are_the_librarys(kind: str, tmp_path: Path) -> None:
    """What the other processors are compared with, with the libm of both: to the last bit."""
    case = WARM[kind]
    here = played("x86-64", case, tmp_path / "here", plain_math=False)
    np.testing.assert_array_equal(here.outputs, by_library(case))
    assert here.began == 0
    assert np.ptp(here.outputs[:, 0]) > 5e-3


@pytest.mark.parametrize("target", ["m7", "aarch64"])
@pytest.mark.parametrize("kind", KINDS)
def test_outputs_are_the_same_to_the_bit(target: str, kind: str, tmp_path: Path) -> None:
    case = WARM[kind]
    there = played(target, case, tmp_path / "there")
    here = played("x86-64", case, tmp_path / "here")
    np.testing.assert_array_equal(there.outputs, here.outputs)
    assert (there.block, there.began) == (here.block, 0)
    assert there.counts.min() > 0
    # Work is even, but the last sample of a predictor's window, and some of a plan's, have more of it: it was counted
    dear = there.counts[case.Np - 1 :: case.Np] if kind == "predictor" else there.counts
    assert dear.max() > 1.5 * np.median(there.counts)


@pytest.mark.parametrize("target", ["m7", "m7-picolibc", "m4f"])
@pytest.mark.parametrize("kind", KINDS)
def test_outputs_with_its_own_mathematics(target: str, kind: str, tmp_path: Path) -> None:
    case = WARM[kind]
    there = played(target, case, tmp_path / "there", plain_math=False)
    np.testing.assert_allclose(there.outputs, by_library(case), rtol=0.0, atol=AGREES[kind])


def test_contracted_products_would_be_seen(tmp_path: Path) -> None:
    """The comparison has teeth: with the multiply-adds of the Cortex-M7, which round once, the bits are others."""
    case = WARM["predictor"]
    contracted = played("m7", case, tmp_path / "there", options=("-ffp-contract=fast",))
    here = played("x86-64", case, tmp_path / "here")
    assert (contracted.outputs != here.outputs).any()


RUN_WASI = (sys.executable, str(SUPPORT / "run_wasi.py"))
WASM = Target("wasm32", tuple(zig("-target", "wasm32-wasi")), "board_host.c", emulator=RUN_WASI)


@pytest.mark.parametrize("kind", KINDS)
def test_outputs_are_those_of_this_machine(kind: str, tmp_path: Path) -> None:
    """The paper's drive, window and lags, warm; its libm is musl's."""
    case = Case(kind, 100, 50, 40, warm=True)
    there, here = (
        replay(target, build(target, case, tmp_path / target.name), count=False) for target in (WASM, TARGETS["x86-64"])
    )
    np.testing.assert_allclose(there.outputs, here.outputs, rtol=0.0, atol=1e-12)
    assert (there.block, there.began) == (here.block, 0)
    assert len(there.outputs) == 4000
    assert np.ptp(there.outputs[:, 0]) > 5e-3
