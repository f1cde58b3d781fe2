"""Decimation of drawn lines: extremes and gaps stay, the number of points is bounded."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsep.evaluate.decimation import drawn_places


@given(n=st.integers(1, 3000), columns=st.integers(1, 300), seed=st.integers(0, 9))
def test_each_column_keeps_its_extremes(n: int, columns: int, seed: int) -> None:
    y = np.random.default_rng(seed).normal(size=n)
    places = drawn_places(columns, y)
    assert (np.diff(places) > 0).all()
    assert places[0] == 0
    assert places[-1] == n - 1
    assert len(places) <= 2 * columns + 2
    edges = np.linspace(0, n, columns + 1).astype(int)
    for begin, end in pairwise(edges):
        kept = y[places[(places >= begin) & (places < end)]]
        if n > 2 * columns:
            assert kept.max() == y[begin:end].max()
            assert kept.min() == y[begin:end].min()
    assert y[places].max() == y.max()
    assert y[places].min() == y.min()


@pytest.mark.parametrize("place", [0, 1, 777, 29_998, 59_999])
@pytest.mark.parametrize("height", [-9.0, 9.0])
def test_a_peak_of_one_sample_in_60_000_stays(place: int, height: float) -> None:
    y = np.sin(0.3 * np.arange(60_000))
    y[place] = height
    places = drawn_places(1000, y)
    assert place in places
    assert len(places) <= 2002


def test_both_edges_of_a_band_keep_their_extremes() -> None:
    n = 60_000
    lower, upper = -np.ones(n), np.ones(n)
    lower[12_345], upper[23_456] = -5.0, 5.0
    places = drawn_places(500, lower, upper)
    assert {12_345, 23_456} <= set(places.tolist())
    assert len(places) <= 4 * 500 + 2


def test_what_is_unknown_stays_a_gap_and_hides_no_peak() -> None:
    y = np.sin(0.01 * np.arange(60_000))
    y[20_000:30_000] = np.nan
    y[40_000], y[40_001], y[40_002] = np.nan, 7.0, np.nan
    drawn = y[drawn_places(1000, y)]
    assert np.isnan(drawn).sum() >= 160
    assert np.nanmax(drawn) == 7.0
    assert len(drawn_places(10, np.full(100, np.nan))) == 11


def test_short_lines_stay_whole() -> None:
    assert drawn_places(50, np.zeros(100)).tolist() == list(range(100))
