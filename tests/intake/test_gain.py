"""Sign and scale of a drive of known dynamics along motions on which no lag is the right one: swept sines."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.signal import chirp
from spoiled_logs import log_of

from hybridsep import ModalModel, Mode
from hybridsep.base.signals import Array
from hybridsep.intake.check import check
from hybridsep.logs.log import Log

T_S = 1e-3


def response(x_d: Array, f_n: float, zeta: float, dead_time: int = 0) -> Array:
    model = ModalModel([Mode(f_n, zeta, (2 * np.pi * f_n) ** 2)], dead_time)
    discrete = model.discretise(T_S, "zoh")
    noise = np.random.default_rng(1).normal(0.0, 2e-7, len(x_d))
    return np.asarray(discrete.forced_response(discrete.rest(), x_d)[0] + noise)


def swept(first: float, last: float, f_n: float, zeta: float, *, dead_time: int = 0, gain: float = 1.0) -> Log:
    t = T_S * np.arange(15000)
    sine = 5e-4 * chirp(t, first, t[-1], last, phi=-90)
    x_d = np.concatenate((np.zeros(300), sine, np.full(300, sine[-1])))
    return log_of(x_d, gain * response(x_d, f_n, zeta, dead_time), T_S)


RANGES = [(0.5, 80.0), (5.0, 80.0), (20.0, 100.0), (0.1, 30.0)]
BY_DAY = [(band, f_n, 0.2) for band, f_n in zip(RANGES, (30.0, 60.0, 10.0, 10.0), strict=True)]
"""Sweeps of a drive, each band once."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("band", "f_n", "zeta"),
    [
        pytest.param(*sweep, marks=[] if sweep in BY_DAY else [pytest.mark.nightly])
        for sweep in itertools.product(RANGES, (10.0, 30.0, 60.0), (0.2, 0.45))
    ],
)
def test_the_sign_of_a_swept_sine(band: tuple[float, float], f_n: float, zeta: float) -> None:
    """The line at the best lag has gain -0.2 for a drive of 30 Hz swept to 80 Hz."""
    assert check(swept(*band, f_n, zeta)).findings == ()
    flipped = check(swept(*band, f_n, zeta, gain=-1.0))
    assert [finding.name for finding in flipped.findings] == ["sign"]
    (finding,) = flipped.findings
    assert finding.evidence["gain"] < 0.0
    np.testing.assert_allclose(flipped.fixed().x_meas, swept(*band, f_n, zeta).x_meas)


@pytest.mark.parametrize("dead_time", [5, 10])
@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_the_sign_of_a_late_swept_sine(dead_time: int, gain: float) -> None:
    found = [finding.name for finding in check(swept(0.5, 80.0, 30.0, 0.2, dead_time=dead_time, gain=gain)).findings]
    assert ("sign" in found) == (gain < 0.0)
    assert "scale" not in found


def test_the_scale_of_a_swept_sine() -> None:
    """The gain is the static one, not the gain at frequencies where the drive no longer follows."""
    (finding,) = check(swept(0.5, 80.0, 30.0, 0.45, gain=1e3)).findings
    assert finding.name == "scale"
    assert "measured in mm, commanded in m" in finding.words


@pytest.mark.parametrize("f", [0.5, 5.0, 20.0])
@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_the_sign_of_one_sine_below_the_bandwidth(f: float, gain: float) -> None:
    x_d = 1e-3 * np.sin(2 * np.pi * f * T_S * np.arange(8000))
    found = [finding.name for finding in check(log_of(x_d, gain * response(x_d, 30.0, 0.4), T_S)).findings]
    assert ("sign" in found) == (gain < 0.0)


@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_no_sign_is_wrong_where_neither_explains_the_motion(gain: float) -> None:
    x_d = swept(0.5, 80.0, 30.0, 0.45).x_d
    other = np.cumsum(np.random.default_rng(2).normal(0.0, 1e-4, len(x_d)))
    found = [finding.name for finding in check(log_of(x_d, gain * other, T_S)).findings]
    assert "sign" not in found
