"""Features of the reference against their formula."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_feature_cases import SCALE, SHIFTS, TS, V_S, formula, reversing

from hybridsep.base.signals import Array
from hybridsep.predict.reference_features import ReferenceFeatures


def windows(features: ReferenceFeatures, path: Array, start: float, lengths: Sequence[int], ahead: int) -> list[Array]:
    """Return the features of consecutive windows, of each of which ``ahead`` more samples of the path are known."""
    found, first = [], 0
    for n in lengths:
        known = path[first : first + n + ahead]
        signs = features.signs(known, start)
        found.append(features.features(signs, n))
        features.advance(signs, known, n)
        first += n
    return found


@pytest.mark.parametrize("start", [0.0, 0.3])
@pytest.mark.parametrize("ahead", [0, 7, 40, 150])
def test_features_are_those_of_the_formula_from_window_to_window(start: float, ahead: int) -> None:
    """Leads that reach beyond what is known see the path at rest there; lags go on over the windows' ends."""
    path = reversing(400, start) + 1e-5
    lengths = (50, 50, 1, 39, 100, 10, 150)
    first = 0
    for n, features in zip(lengths, windows(ReferenceFeatures(V_S, TS), path, start, lengths, ahead), strict=True):
        known = min(first + n + ahead, len(path))
        expected = formula(path.tolist(), start, first, n, known)
        np.testing.assert_allclose(features, expected, rtol=0, atol=1e-15)
        first += n
    assert np.abs(features).max() > 0.5 * SCALE


@settings(max_examples=60)
@given(cuts=st.lists(st.integers(1, 90), min_size=1, max_size=9), seed=st.integers(0, 2**31))
def test_how_windows_are_cut_changes_nothing_where_the_same_is_known(cuts: list[int], seed: int) -> None:
    n = sum(cuts)
    path: Array = np.cumsum(np.random.default_rng(seed).normal(0, V_S * TS, n + 40))
    parts = windows(ReferenceFeatures(V_S, TS), path, 0.0, cuts, len(path))
    (whole,) = windows(ReferenceFeatures(V_S, TS), path, 0.0, [n], 40)
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_a_new_run_begins_at_rest() -> None:
    features, path = ReferenceFeatures(V_S, TS), reversing(100, 0.1)
    (before,) = windows(features, path, 0.1, [100], 0)
    features.restart()
    np.testing.assert_array_equal(windows(features, path, 0.1, [100], 0)[0], before)
    assert not windows(ReferenceFeatures(V_S, TS), np.full(100, 0.1), 0.1, [100], 0)[0].any()


def test_fast_friction_is_a_sign_and_slow_friction_viscous() -> None:
    path = 0.01 * TS * np.arange(1.0, 101.0)  # 10 mm/s
    at = SHIFTS.index(0)
    (fast,) = windows(ReferenceFeatures(1e-5, TS), path, 0.0, [100], 0)
    (slow,) = windows(ReferenceFeatures(1.0, TS), path, 0.0, [100], 0)
    np.testing.assert_allclose(fast[:, at], SCALE, rtol=1e-12)
    np.testing.assert_allclose(slow[:, at], SCALE * 0.01, rtol=1e-4)
