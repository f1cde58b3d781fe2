"""Peers on the raw columns: ARX and lag + hold against slow copies of their definitions, on recordings and by hand."""

import numpy as np
import pytest
from oracle import arx_by_definition, free_run_by_definition
from scipy.signal import lfilter

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.evaluate.peers import (
    FROZEN,
    LAG_HOLD,
    REFITTED,
    FirstOrderLag,
    MinimumNorm,
    Peer,
    Piece,
    fitted_lag,
    predict_peers,
)

NP = 25


def axis(n: int = 600, seed: int = 0) -> tuple[Array, Array]:
    """Command and measurement of an axis of second order under a random, smooth command."""
    rng = np.random.default_rng(seed)
    x_d = np.cumsum(lfilter([0.02], [1.0, -0.98], rng.normal(0.0, 1e-3, n))) + 0.1
    return x_d, x_d[0] + lfilter([0.05, 0.02], [1.0, -1.6, 0.67], x_d - x_d[0]) + rng.normal(0.0, 1e-6, n)


def peer(found: tuple[Peer, ...], name: str, way: str) -> Peer:
    [one] = [peer for peer in found if (peer.name, peer.way) == (name, way)]
    return one


def test_of_dependent_columns_the_solution_is_of_minimum_norm() -> None:
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(60, 7))
    rows[:, 3] = 2.0 * rows[:, 1]
    rows[:, 5] = 0.0
    least_squares = MinimumNorm(6)
    for i in range(0, 60, 7):
        least_squares.add(rows[i : i + 7])
        direct = np.linalg.lstsq(rows[: i + 7, :-1], rows[: i + 7, -1], rcond=None)[0]
        np.testing.assert_allclose(least_squares.solution(), direct, rtol=0, atol=1e-12)


@pytest.mark.parametrize("missing", [(), range(290, 312), range(395, 405)])
def test_windows_are_free_runs_from_what_was_measured_before(missing: range) -> None:
    x_d, x = axis()
    x[list(missing)] = np.nan
    found = predict_peers([Piece(x_d, x, 300, 300)], NP)
    frozen, refitted = peer(found, "ARX20", FROZEN).predictions[0], peer(found, "ARX20", REFITTED).predictions[0]
    assert np.isnan(frozen[:300]).all()
    assert not np.isnan(frozen[300:]).any()
    w = arx_by_definition(x_d, x, 20, 300)
    for k in range(300, 600, NP):
        window = slice(k, k + NP)
        expected = free_run_by_definition(w, x_d, x, 20, k, k + NP)
        np.testing.assert_allclose(frozen[window], expected, rtol=0, atol=1e-9)
    if not missing:  # a gap is bridged by the coefficients that were known when it ended
        for k in range(300, 600, NP):
            expected = free_run_by_definition(arx_by_definition(x_d, x, 20, k), x_d, x, 20, k, k + NP)
            np.testing.assert_allclose(refitted[k : k + NP], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("every", [5, 7, 15])
def test_missing_measurements_cost_an_arx_little(every: int) -> None:
    x_d, x = axis()
    missing = x.copy()
    missing[::every] = np.nan
    for name in ("ARX20", "ARX40"):
        errors = [
            rms((x - peer(predict_peers([Piece(x_d, one, 300, 300)], NP), name, REFITTED).predictions[0])[300:])
            for one in (missing, x)
        ]
        assert errors[0] < 1.3 * errors[1]


@pytest.mark.parametrize("delay", [3, 30])
def test_late_measurements_are_those_of_earlier_positions(delay: int) -> None:
    x_d, x = axis()
    late = np.concatenate((np.full(delay, x[0]), x[:-delay]))
    found = peer(predict_peers([Piece(x_d, late, 300, 300)], NP, delay=delay), "ARX20", FROZEN).predictions[0]
    w = arx_by_definition(x_d, x, 20, 300 - delay)
    for k in range(300, 600 - NP - delay, NP):  # the window's predictions stand where its measurements do
        expected = free_run_by_definition(w, x_d, x, 20, k - delay, k + NP)[delay:]
        np.testing.assert_allclose(found[k + delay : k + delay + NP], expected, rtol=0, atol=1e-9)
    assert not np.isnan(found[300:]).any()


def test_without_samples_that_train_there_are_refitted_models_alone() -> None:
    x_d, x = axis()
    found = predict_peers([Piece(x_d, x, 0, 0)], NP)
    assert [one.title for one in found] == ["ARX20 (refitted)", "ARX40 (refitted)"]
    np.testing.assert_array_equal(found[0].predictions[0][:NP], x_d[:NP])  # nothing is known


def test_an_unstable_model_diverges() -> None:
    x_d = 0.01 * np.sin(0.05 * np.arange(900))
    x = x_d + 1e-9 * 1.08 ** np.arange(900.0).clip(max=150)  # what trains grows by 8 % a sample
    assert peer(predict_peers([Piece(x_d, x, 140, 150)], 700), "ARX20", FROZEN).diverged


def test_an_axis_without_lag_has_none_in_its_peer() -> None:
    """It was late by the sample of a hold at least: 9.7 mm beside hold's 0.5."""
    x_d, _ = axis(2000)
    held = peer(predict_peers([Piece(x_d, x_d.copy(), 1000, 1000)], 100), LAG_HOLD, "").predictions[0]
    np.testing.assert_allclose(held[1000:], x_d[1000:], rtol=0, atol=1e-9)


def test_a_lag_needs_motion_to_be_fitted_to() -> None:
    x_d, x = axis()
    x_d[:300] = x_d[300]
    found = predict_peers([Piece(x_d, x, 300, 300)], NP)
    arx = {f"ARX{n} ({way})" for n in (20, 40) for way in (FROZEN, REFITTED)}
    assert {one.title for one in found} == {*arx, "N4SID"}


def test_a_lag_is_found_and_its_last_measured_residual_held() -> None:
    x_d, _ = axis(2000)
    true = FirstOrderLag(12.0, 4)
    x = true.position(x_d) + 2e-3  # another zero
    x[1190:1200] = np.nan
    lag = fitted_lag([(x_d[:1000], x[:1000])])
    assert lag.tau == pytest.approx(12.0, rel=1e-2)
    assert lag.late == 4
    held = peer(predict_peers([Piece(x_d, x, 1000, 1000)], 100), LAG_HOLD, "").predictions[0]
    x_lag = lag.position(x_d)
    np.testing.assert_allclose(held[1200:1300], x_lag[1200:1300] + (x - x_lag)[1189], rtol=0, atol=1e-15)
    np.testing.assert_allclose(held[1300:1400], x_lag[1300:1400] + (x - x_lag)[1299], rtol=0, atol=1e-15)


@pytest.mark.parametrize("missing", [(), range(1290, 1312)])
@pytest.mark.parametrize("delay", [0, 3])
def test_a_state_space_model_is_found_with_its_filter(missing: range, delay: int) -> None:
    """Of an axis of second order with an offset and coloured noise: no worse than a long ARX, which is refitted."""
    rng = np.random.default_rng(3)
    x_d, x = axis(3000)
    x = x + 1e-3 + lfilter([1.0], [1.0, -0.9], rng.normal(0.0, 2e-6, len(x)))
    x = np.concatenate((np.full(delay, x[0]), x[: len(x) - delay]))
    x[list(missing)] = np.nan
    found = predict_peers([Piece(x_d, x, 1500, 1500)], NP, delay=delay)
    errors = {one.title: np.sqrt(np.nanmean((one.predictions[0] - x)[1500:] ** 2)) for one in found}
    assert errors["N4SID"] < 1.02 * errors["ARX40 (refitted)"]
    assert errors["N4SID"] < 0.5 * errors["lag + hold"]
    assert delay or np.isnan(peer(found, "N4SID", "").predictions[0][:1500]).all()
