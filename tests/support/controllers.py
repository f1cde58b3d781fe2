"""Processors of controllers in qemu: what their tests need, and where they are skipped."""

import os

import pytest

from benchmarks.targets.targets import TARGETS, Target

NEEDED = "HYBRIDSEP_CONTROLLERS"
"""Environment variable: a compiler or an emulator that is missing is a failure, not a reason to skip."""


def target_or_skip(name: str) -> Target:
    """Return a target; skip the test where its compiler or its emulator is not installed."""
    target = TARGETS[name]
    if missing := target.missing():
        said = f"{missing} is missing: apt install {target.packages}"
        assert not os.environ.get(NEEDED), said
        pytest.skip(said)
    return target
