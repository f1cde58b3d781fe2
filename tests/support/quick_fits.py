"""``fit`` without what takes most of its time, for tests of other things."""

from __future__ import annotations

import pytest

from hybridsep.fmi.flavours import FLAVOURS
from hybridsep.identify.structure import STRUCTURES


def without_larger_structures(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` try structures of a lag or one mode alone: half of its time."""
    small = [one for one in STRUCTURES if one.n_modes + one.lag <= 1]
    patch.setattr("hybridsep.identify.operation.STRUCTURES", small)


def without_python_fmus(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` write the native FMUs alone: a tenth of its time."""
    patch.setattr("hybridsep.fitting.build.FLAVOURS", FLAVOURS[:1])


def without_other_settings(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` try the default settings alone: a fifth of its time."""
    patch.setattr("hybridsep.fitting.choice._SHARES", ())
    patch.setattr("hybridsep.fitting.choice._Q", ())
