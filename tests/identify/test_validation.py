"""Validation of an identified model: the log's own frequency response, and tests of the residual."""

import numpy as np
import pytest
from identification_cases import T_S, correlated, measured, moves
from scipy.signal import coherence, csd, welch

from hybridsep import ModalModel, Mode
from hybridsep.base.signals import Array
from hybridsep.identify.validation import FrequencyResponse, frequency_response, model_response, residual_test

AXIS = ModalModel([Mode(40.0, 0.1, (80 * np.pi) ** 2, 0.0)], dead_time=8)
OTHER = ModalModel([Mode(36.0, 0.15, (72 * np.pi) ** 2, 0.0)], dead_time=8)
N = 20_000


def wandering(seed: int) -> Array:
    """Return a command with power at all frequencies, (n,), m."""
    return np.cumsum(1e-5 * np.random.default_rng(seed).standard_normal(N))


def responses(*pieces: tuple[Array, Array], model: ModalModel = OTHER) -> FrequencyResponse:
    """Return the response of commanded and measured positions, of which a model is known that is wrong by 10 %."""
    found = frequency_response([(x_d, x, x - measured(model, x_d, "foh")) for x_d, x in pieces], T_S, model, "foh")
    assert found is not None
    return found


def response(x_d: Array, noise: float, seed: int = 1) -> FrequencyResponse:
    return responses((x_d, measured(AXIS, x_d, "foh", noise, seed)))


def test_the_model_is_discrete_under_its_hold() -> None:
    f = np.linspace(1.0, 60.0, 30)
    closed_form = AXIS.frequency_response(2 * np.pi * f, T_S)
    hold = np.sinc(f * T_S) ** 2  # of a triangle between samples, beside what is aliased
    np.testing.assert_allclose(model_response(AXIS, T_S, "foh", f), closed_form * hold, rtol=1e-3)


def test_a_second_order_axis_is_as_its_closed_form() -> None:
    found = response(moves(N), 0.0)
    below = found.known & (found.f < 80.0)
    assert below.sum() > 75
    truth = AXIS.frequency_response(2 * np.pi * found.f[below], T_S) * np.sinc(found.f[below] * T_S) ** 2
    off = np.abs(found.G[below] / truth - 1.0)
    assert off.max() < 0.08  # at the resonance, 8 Hz wide, which segments of 1 s smear; the model is off by 60 %
    assert np.median(off) < 0.01
    x_d = moves(N)
    right = responses((x_d, measured(AXIS, x_d, "foh")), model=AXIS)
    np.testing.assert_allclose(right.G[right.known], right.expected[right.known], rtol=1e-6)


def test_the_interval_has_the_truth_in_95_of_100() -> None:
    within = []
    for seed in range(12):
        found = response(wandering(seed), 5e-6, seed + 100)
        ratio = (found.G / model_response(AXIS, T_S, "foh", found.f))[found.known]
        within += [off <= found.half[found.known] for off in (np.abs(np.abs(ratio) - 1.0), np.abs(np.angle(ratio)))]
    assert 0.88 < np.concatenate(within).mean() < 0.98


def test_it_is_what_scipy_has() -> None:
    x_d = wandering(0)
    x = measured(AXIS, x_d, "foh", 1e-6)
    found = responses((x_d, x), model=ModalModel([Mode(400.0, 1.0, 1e-12, 0.0)]))  # which does not move
    u, y = np.diff((x_d, x), 2)
    how = {"fs": 1 / T_S, "window": "blackmanharris", "nperseg": round(1 / (found.f[0] * T_S)), "detrend": False}
    f, both = csd(u, y, **how)
    np.testing.assert_allclose(found.f, f[1:-1])
    np.testing.assert_allclose(found.G, (both / welch(u, **how)[1])[1:-1], rtol=1e-9)
    np.testing.assert_allclose(found.coherence, coherence(u, y, **how)[1][1:-1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_where_a_command_has_no_power_nothing_is_known(noise: float) -> None:
    found = response(0.01 * np.sin(6 * np.pi * T_S * np.arange(N)), noise)
    np.testing.assert_allclose(found.f[found.known], 3.0, atol=3.0)


def test_where_one_segment_has_all_power_nothing_is_known() -> None:
    assert not response(np.where(np.arange(N) < 10_000, 0.0, 1e-3), 0.0).known.any()


def test_no_segment_reaches_over_a_gap_or_a_missing_sample() -> None:
    x_d = wandering(0)
    x = measured(AXIS, x_d, "foh", 1e-6)
    whole = responses((x_d, x))
    cut = x.copy()
    cut[10_000] = np.nan
    missing = responses((x_d, cut))
    pieces = responses((x_d[:10_000], x[:10_000]), (x_d[10_000:] + 1.0, x[10_000:] + 1.0))
    assert whole.n_segments - missing.n_segments == 2
    assert np.abs(pieces.G / whole.G - 1.0)[whole.f < 20.0].max() < 0.05


def test_a_short_log_or_one_at_rest_has_no_response() -> None:
    for x in (np.arange(500.0), np.zeros(N)):
        assert frequency_response([(x, x, x)], T_S, AXIS, "foh") is None


def test_a_white_residual_and_a_correlated_one_are_told_apart() -> None:
    x_d = moves(8000)
    alarms = np.zeros(2)
    for seed in range(20):
        white = residual_test([(x_d, x_d, np.random.default_rng(seed).standard_normal(8000))], 100)
        other = residual_test([(x_d, x_d, correlated(8000, 1.0, seed))], 100)
        assert white is not None
        assert other is not None
        assert other.ljung_box > 10 * other.of_white
        assert other.autocorrelation[0] == pytest.approx(1.0)
        assert other.autocorrelation[1] == pytest.approx(0.98, abs=0.02)
        for i, one in enumerate((white, other)):
            alarms[i] += np.any(np.abs(one.with_command) > one.command_band)
        alarms[0] += white.ljung_box > white.of_white
    assert (alarms <= 2).all()


def test_a_residual_that_follows_the_command_is_found_at_its_lag() -> None:
    x_d = moves(8000)
    velocity = np.diff(x_d, prepend=x_d[:1])
    late = np.concatenate((np.zeros(7), velocity[:-7]))
    residual = correlated(8000, 1e-5, 0) + 0.3 * late + 1e-7 * np.random.default_rng(0).standard_normal(8000)
    cut = residual.copy()
    cut[4000:4010] = np.nan
    halves = [(x_d[half], x_d[half], cut[half]) for half in (slice(5000), slice(5000, None))]
    for pieces in ([(x_d, x_d, residual)], halves):
        found = residual_test(pieces, 50)
        assert found is not None
        beyond = np.abs(found.with_command) - found.command_band
        assert beyond.max() > 0.0
        assert abs(int(np.argmax(beyond)) - 7) <= 2


def test_what_does_not_change_is_not_tested() -> None:
    still, rest = np.zeros(1000), np.random.default_rng(0).standard_normal(1000)
    assert residual_test([(still, still, rest)], 50) is None
    assert residual_test([(moves(1000), still, still)], 50) is None
    assert residual_test([(rest[:5], rest[:5], rest[:5])], 50) is None
