"""Fixes of logs: what is left, in which segments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spoiled_logs import log_of

from hybridsep.intake import fixes
from hybridsep.logs.log import Log


def ramp(n: int = 20) -> Log:
    k = np.arange(n, dtype=np.float64)
    return log_of(k, 10 * k)


def starts_of(log: Log) -> list[float]:
    return [float(segment.x_d[0]) for segment in log.segments()]


def test_stretches_are_cut_out_and_kept_apart() -> None:
    log = replace(ramp(), starts=(0, 5))
    cut = fixes.cut_out(log, np.array([2, 10]), np.array([4, 20]))
    np.testing.assert_array_equal(cut.x_d, [0, 1, 4, 5, 6, 7, 8, 9])
    assert cut.starts == (0, 2, 3)
    assert starts_of(cut) == [0, 4, 5]
    assert starts_of(fixes.begin_at(cut, 2)) == [4, 5]
    assert starts_of(fixes.begin_at(cut, 1)) == [1, 4, 5]


def test_short_gaps_are_filled_and_long_ones_cut() -> None:
    keep = np.r_[0:3, 4:8, 13:20]
    log = replace(ramp(), t=ramp().t[keep], x_d=ramp().x_d[keep], x_meas=ramp().x_meas[keep])
    filled = fixes.filled(log, np.array([3, 7]), np.array([1, 5]), 4)
    np.testing.assert_allclose(filled.x_d, np.r_[0:8, 13:20])
    np.testing.assert_allclose(filled.t, 1e-3 * np.r_[0:8, 13:20])
    np.testing.assert_array_equal(np.isnan(filled.x_meas), np.arange(15) == 3)
    assert filled.starts == (0, 8)
    apart = fixes.filled(log, np.array([3, 7]), np.array([1, 5]), 0)
    np.testing.assert_array_equal(apart.x_meas, log.x_meas)
    assert apart.starts == (0, 3, 7)


def test_each_segment_is_resampled_by_itself() -> None:
    log = ramp()
    uneven = replace(log, t=log.t * 1.5 + np.where(np.arange(20) >= 10, 0.1, 0.0), starts=(0, 10))
    even = fixes.resampled(uneven)
    assert [len(segment.t) for segment in even.segments()] == [14, 14]
    for segment, first in zip(even.segments(), (0.0, 10.0), strict=True):
        np.testing.assert_allclose(segment.x_d, first + np.arange(14) / 1.5)
        np.testing.assert_allclose(np.diff(segment.t), 1e-3)


@pytest.mark.parametrize("delay", [3.0, 2.25, -4.0])
def test_a_shift_leaves_the_ends_out(delay: float) -> None:
    log = fixes.shifted_back(replace(ramp(), starts=(0, 10)), delay)
    assert len(log.segments()) == 2
    assert len(log.t) == 20 - 2 * int(np.ceil(abs(delay)))
    np.testing.assert_allclose(log.x_meas, 10 * (log.x_d + delay), atol=1e-9)


def test_missing_measurements_stay_missing() -> None:
    log = ramp()
    x = log.x_meas.copy()
    x[[0, 7, 8, 15]] = np.nan
    log = replace(log, x_meas=x)

    def missing(changed: Log, column: str = "x_meas") -> list[int]:
        return [k for k, value in enumerate(getattr(changed, column)) if np.isnan(value)]

    np.testing.assert_allclose(fixes.without_missing(log).x_meas[1:], ramp().x_meas[1:])
    assert missing(fixes.bridge(log, "x_meas", np.array([6, 9]))) == [0, 7, 8, 15]
    np.testing.assert_allclose(fixes.bridge(log, "x_meas", np.array([6, 9])).x_meas[[6, 9]], [60.0, 90.0])
    assert missing(fixes.shifted_back(log, 2.0)) == [5, 6, 13]
    half = fixes.shifted_back(log, 1.5)
    assert missing(half) == [5, 6, 7, 13, 14]  # before and behind each missing one; the first is left out
    known = ~np.isnan(half.x_meas)
    np.testing.assert_allclose(half.x_meas[known], 10 * (half.x_d[known] + 1.5), atol=0.2)
    assert missing(fixes.swapped(log), "x_d") == []
    velocity = replace(log, x_meas=np.where(np.isnan(x), np.nan, 2.0))
    whole = fixes.integrated(velocity, "x_meas", 1.0)
    assert missing(whole) == [0, 7, 8, 15]
    np.testing.assert_allclose(whole.x_meas[1], 2e-3)
    assert missing(fixes.resampled(replace(log, t=log.t + 2e-4))) == [0, 7, 8, 15]
    nothing = replace(log, x_meas=np.full(20, np.nan))
    for change in (fixes.without_missing, lambda log: fixes.bridge(log, "x_meas", np.array([3]))):
        assert missing(change(nothing)) == list(range(20))
    assert len(missing(fixes.shifted_back(nothing, 1.5))) == 18


def test_the_others() -> None:
    log = ramp(9)
    thin = fixes.thinned(log, 3, 2)
    assert (thin.T_s, thin.x_d.tolist()) == (0.003, [2, 5, 8])
    assert fixes.bridge(log, "x_meas", np.array([3, 4])).x_meas.tolist() == log.x_meas.tolist()
    assert fixes.swapped(log).x_d.tolist() == log.x_meas.tolist()
    mixed = replace(log, t=log.t[[0, 2, 1, 1, 3, 4, 5, 6, 7]])
    assert fixes.in_order(mixed).x_d.tolist() == [0, 2, 1, 4, 5, 6, 7, 8]
    velocity = replace(log, x_meas=np.full(9, 2.0))
    np.testing.assert_allclose(fixes.integrated(velocity, "x_meas", 1.0).x_meas, 2e-3 * np.arange(9))
    assert fixes.scaled(log, 2.0, unit="rad").unit == "rad"
