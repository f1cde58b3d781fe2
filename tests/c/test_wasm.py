"""The C library compiled for WebAssembly by zig, in wasmtime; `.ci/nightly` installs it."""

import sys
from pathlib import Path

import numpy as np
import pytest
from places import SUPPORT

from benchmarks.targets.cases import KINDS, Case
from benchmarks.targets.targets import TARGETS, Target, build, replay

WASM = Target(
    "wasm32",
    (sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi"),
    "board_host.c",
    emulator=(sys.executable, str(SUPPORT / "run_wasi.py")),
)


@pytest.mark.nightly
@pytest.mark.slow
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
