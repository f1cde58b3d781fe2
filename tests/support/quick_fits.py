"""``fit``, and the building of FMUs, without what takes most of their time, for tests of other things."""

import pytest

from hybridsep.identify.structure import STRUCTURES


def without_larger_structures(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` try structures of only a lag or one mode: half of its time."""
    small = [one for one in STRUCTURES if one.n_modes + one.lag <= 1]
    patch.setattr("hybridsep.identify.operation.STRUCTURES", small)


def without_other_settings(patch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` try only the default settings: a fifth of its time."""
    patch.setattr("hybridsep.fitting.lags._SHARES", ())
    patch.setattr("hybridsep.fitting.lags._Q", ())


def with_short_references(patch: pytest.MonkeyPatch) -> None:
    """Let look-aheads that are built have reference runs of 30 samples: most of the time of a SepCompensator."""
    patch.setattr("hybridsep.fmi.reference._SAMPLES_MAX", 30)
