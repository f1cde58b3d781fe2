"""``fit`` without what takes most of its time, for tests of other things."""

from __future__ import annotations

import pytest

__all__ = ["without_binaries", "without_compiler", "without_other_windows"]


def without_binaries(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` build both flavours, the native one without its binary, and time no steps."""
    patch.setattr("hybridsep.fmi.native_flavour.binaries", lambda *_arguments: {})
    patch.setattr(
        "hybridsep.app.fit.step_times", lambda *_arguments: dict.fromkeys(("median", "p99_9", "largest"), 0.0)
    )


def without_compiler(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` build the Python flavour alone, as where there is no C compiler: a third to a half of its time."""
    patch.setattr("hybridsep.app.fit.can_compile", lambda: False)


def without_other_windows(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` judge the controller's look-ahead alone, none that are shorter or longer: a fifth of its time."""
    patch.setattr("hybridsep.tune.choice._WINDOWS", (1.0,))
