"""Identification from operation: simulated axes are found again, recordings that train nothing are refused."""

import json

import numpy as np
import pytest
from identification_cases import T_S, correlated, measured, moves
from places import EMPS, RECORDINGS
from scipy import io
from scipy.signal import lfilter

from hybridsep import Limits, ModalModel, Mode, rest_to_rest
from hybridsep.base.errors import IdentificationError
from hybridsep.base.signals import Array
from hybridsep.identify.model import IdentifiedModel
from hybridsep.identify.operation import TOO_LITTLE, identify_operation, unit_gain_model
from hybridsep.identify.output_error import Delay, Problem, as_segments, fit_structure, without
from hybridsep.identify.selection import slow_parts
from hybridsep.identify.structure import Structure, lag_mode
from hybridsep.identify.uncertainty import estimates

LAG = ModalModel([lag_mode(8e-3)], dead_time=3)
SECOND = ModalModel([Mode(20.0, 0.4, (40 * np.pi) ** 2, 0.0)])


def value(found: IdentifiedModel, name: str) -> tuple[float, float]:
    estimate = next(estimate for estimate in found.parameters if estimate.name == name)
    return estimate.value, estimate.std


def difference(found: IdentifiedModel, truth: ModalModel, input_hold: str, x_d: Array) -> float:
    """Return the largest difference of the responses to a command, m."""
    return float(np.abs(measured(found.model, x_d, found.input_hold) - measured(truth, x_d, input_hold)).max())


def test_a_lag_as_a_mode_is_exact() -> None:
    omega = np.geomspace(0.1, 1e4, 50)
    G = ModalModel([lag_mode(5e-3, 0.9)]).frequency_response(omega)
    np.testing.assert_allclose(G, 0.9 / (1 + 5e-3j * omega), rtol=1e-12)


@pytest.mark.slow
def test_a_lag_with_dead_time_is_found() -> None:
    x_d = moves(2000)
    found = identify_operation([(x_d, measured(LAG, x_d, "zoh", 1e-6))], T_S)
    assert found.structure == "first-order lag, gain 1"
    assert (found.model.dead_time, found.input_hold) == (3, "zoh")
    tau, std = value(found, "lag.tau")
    assert 0 < std < 5e-6
    assert abs(tau - 8e-3) < 4 * std
    assert found.rms == pytest.approx(1e-6, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("sag", "friction", "order_max"), [(60.0, 6.0, 2), (0.0, 30.0, 4)])
def test_an_arm_that_sags_or_rubs_has_poles_not_a_dead_time(sag: float, friction: float, order_max: int) -> None:
    """A PD servo of 3.56 Hz, ζ 0.56, a sample late: sagging by cos(x) a lag and 58 ms, rubbed two modes, fit better."""
    x_d, T_s = _reaches(6000, 2e-3), 2e-3
    x, position, velocity = np.empty_like(x_d), x_d[0] - sag / 2000.0 * np.cos(x_d[0]), 0.0
    for k, late in enumerate(np.concatenate((x_d[:1], x_d[:-1]))):
        x[k] = position
        for _ in range(8):
            rubs = 100.0 * velocity + friction * np.tanh(velocity / 0.01)
            velocity += (2000.0 * (late - position) - sag * np.cos(position) - rubs) / 4.0 * T_s / 8
            position += velocity * T_s / 8
    found = identify_operation([(x_d, x)], T_s, unit="rad", order_max=order_max)
    assert found.structure.startswith("second order, gain")
    assert found.model.dead_time <= 2
    assert value(found, "mode[1].f_n")[0] == pytest.approx(3.56, rel=0.2)
    assert value(found, "mode[1].zeta")[0] == pytest.approx(0.56, rel=0.2 if sag else 0.8)


@pytest.mark.slow
def test_poles_that_friction_does_not_explain_are_the_drives() -> None:
    """A mode and a lag without friction: a second order leaves a twentieth more than noise, and is another one."""
    targets, starts = np.random.default_rng(9).uniform(-0.004, 0.004, 16).tolist(), 0.3 + 0.75 * np.arange(16)
    x_d = rest_to_rest([0.0, *targets], Limits(0.1, 0.5, 10.0), T_S, start_times=starts.tolist(), duration=12.3)
    discrete = ModalModel([Mode(20.0, 0.5, (40 * np.pi) ** 2)]).discretise(T_S)
    lag = np.exp(-16 * np.pi * T_S)
    x = lfilter([0.0, 1.0 - lag], [1.0, -lag], discrete.forced_response(discrete.rest(), x_d)[0])
    found = identify_operation([(x_d, x + np.random.default_rng(1).normal(0.0, 1e-6, len(x)))], T_S, order_max=3)
    assert value(found, "mode[1].f_n")[0] == pytest.approx(20.0, rel=0.05)
    assert value(found, "mode[1].zeta")[0] == pytest.approx(0.5, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("f_n", "zeta", "friction"), [(25.0, 0.5, 0.015), (14.0, 0.3, 0.008)])
def test_a_servo_with_feed_forward_that_friction_hides_is_no_mode_that_rings(
    f_n: float, zeta: float, friction: float
) -> None:
    """A proportional loop around a proportional-integral one: without a zero, hardly any damping fits as well."""
    t, omega = T_S * np.arange(8000), 2 * np.pi * f_n
    x_d = 4e-3 * np.sin(2 * np.pi * (0.3 * t + 0.08 * t**2))
    x, position, velocity, integral = np.zeros_like(x_d), 0.0, 0.0, 0.0
    for k in range(1, len(x_d)):
        forward, dt = (x_d[k] - x_d[k - 1]) / T_S, T_S / 10
        for i in range(10):
            late = x_d[k - 1] + forward * (i + 1) * dt - position
            error = omega / (2 * zeta) * late + forward - velocity
            integral += error * dt / 0.12
            velocity += dt * 2 * zeta * omega * (error + integral - friction * np.tanh(velocity / 1e-4))
            position += dt * velocity
        x[k] = position
    found = identify_operation([(x_d, x)], T_S, order_max=2)
    assert found.structure.startswith("second order with zero and ζ 0.5")
    mode = found.model.modes[0]
    assert mode.f_n == pytest.approx(f_n, rel=0.4)
    assert mode.beta == pytest.approx(2 * mode.zeta * mode.omega, rel=0.2)  # hardly a lag
    assert any("does not tell how the loop is damped" in one for one in found.findings)


@pytest.mark.slow
@pytest.mark.parametrize(("f_n", "zeta"), [(11.0, 0.07), (2.5, 0.008)])
def test_a_mode_that_rings_in_the_log_is_kept(f_n: float, zeta: float) -> None:
    """The second decays in 8 s, of which the log has half, but swings ten times there, as a crane's load."""
    truth = ModalModel([Mode(f_n, zeta, (2 * np.pi * f_n) ** 2, 0.0)])
    x_d = moves(6000)
    found = identify_operation([(x_d, measured(truth, rubbed(x_d, 20e-6), "zoh", 1e-6))], T_S, order_max=2)
    assert found.structure.startswith("second order, gain")
    assert value(found, "mode[1].zeta")[0] == pytest.approx(zeta, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("noise_std", [2e-5, 2e-4])
def test_a_dead_time_that_the_log_shows_is_kept(noise_std: float) -> None:
    """With more noise the errors of a shorter one are within a tenth, which white samples contradict all the same."""
    truth = ModalModel([Mode(8.0, 0.7, (16 * np.pi) ** 2, 0.0)], dead_time=40)
    x_d = moves(6000)
    found = identify_operation([(x_d, measured(truth, x_d, "zoh", noise_std))], T_S, order_max=2)
    assert found.model.dead_time == 40


def _reaches(n: int, T_s: float) -> Array:
    """Return rest-to-rest moves of an arm, ``(n,)``, rad."""
    rng = np.random.default_rng(1)
    pieces = [np.full(100, -0.5)]
    while sum(map(len, pieces)) < n:
        begin, steps = pieces[-1][-1], round(rng.uniform(0.8, 1.6) / T_s)
        goal = np.clip(begin + rng.choice((-1, 1)) * rng.uniform(0.2, 0.8), -1.2, 1.2)
        u = np.arange(1, steps + 1) / steps
        pieces.append(begin + (goal - begin) * (10 * u**3 - 15 * u**4 + 6 * u**5))
        pieces.append(np.full(1 + round(rng.uniform(0.0, 0.4) / T_s), goal))
    return np.concatenate(pieces)[:n]


def test_a_second_order_axis_with_an_offset_is_found() -> None:
    x_d = moves(2000)
    found = identify_operation([(x_d, measured(SECOND, x_d, "foh", 1e-6) + 5e-3)], T_S)
    assert found.structure == "second order, gain 1"
    for name, truth in (("mode[1].f_n", 20.0), ("mode[1].zeta", 0.4), ("offset", 5e-3)):
        estimate, std = value(found, name)
        assert 0 < std < 0.002 * truth
        assert abs(estimate - truth) < 4 * std
    assert difference(found, SECOND, "foh", x_d) < 1e-6
    summary = json.loads(json.dumps(found.summary()))
    assert summary["structure"] == found.structure
    assert len(summary["alternatives"]) == len(found.alternatives) == 8
    machine = found.machine("axis", "An axis", predictor={"Np": 20, "p": 20})
    assert (machine.model, machine.predictor_settings.Np) == (found.model, 20)
    assert machine.predictor_settings.input_hold == found.input_hold


@pytest.mark.slow
def test_two_modes_are_found_with_a_gain() -> None:
    omegas = 2 * np.pi * np.array([25.0, 60.0])
    truth = ModalModel([Mode(25.0, 0.3, 0.72 * omegas[0] ** 2, 20.0), Mode(60.0, 0.1, 0.26 * omegas[1] ** 2, -10.0)])
    x_d = moves(1500)
    found = identify_operation([(x_d, measured(truth, x_d, "foh", 1e-7))], T_S, order_max=4)
    assert found.structure == "2 modes, gain free"
    assert sorted(value(found, f"mode[{i}].f_n")[0] for i in (1, 2)) == pytest.approx([25.0, 60.0], rel=0.01)
    assert value(found, "gain")[0] == pytest.approx(0.98, abs=1e-4)
    assert difference(found, truth, "foh", x_d) < 2e-6


@pytest.mark.slow
def test_a_recording_that_starts_in_motion_is_used() -> None:
    x_d = moves(2000)
    x = measured(SECOND, x_d, "foh", 1e-6)
    start = int(np.argmax(np.abs(np.diff(x_d)))) - 5
    found = identify_operation([(x_d[start:], x[start:])], T_S, order_max=2)
    assert value(found, "mode[1].f_n")[0] == pytest.approx(20.0, rel=0.002)


def rubbed(x_d: Array, friction: float) -> Array:
    """Return a command less what rubs, which turns over 30 µm of way, m."""
    z = np.zeros(len(x_d))
    for k, step in enumerate(np.diff(x_d) / 30e-6, 1):
        z[k] = np.clip(z[k - 1] + step - abs(step) * z[k - 1], -1.0, 1.0)
    return np.asarray(x_d - friction * z)


@pytest.mark.slow
def test_friction_is_no_slow_part_of_the_model() -> None:
    """A lag of 35 Hz became a mode of 4.8 Hz with ζ = 4 and a zero that cancels its slow pole."""
    x_d = moves(5000)
    x = measured(ModalModel([lag_mode(1 / (70 * np.pi))], dead_time=1), rubbed(x_d, 20e-6), "zoh", 5e-7)
    found = identify_operation([(x_d, x)], T_S, order_max=2)
    assert found.structure == "first-order lag, gain free"
    assert found.model.modes[0].f_n == pytest.approx(35.0, rel=0.06)
    refused = [other.objection for other in found.alternatives if other.name == "second order with zero, gain 1"]
    assert refused[0].startswith("zeros all but cancel a slow part of 0.")


def mode(f_n: float, zeta: float, gain: float, beta: float = 0.0) -> Mode:
    omega = 2 * np.pi * f_n
    return Mode(f_n, zeta, gain * omega**2, beta * omega)


@pytest.mark.slow
@pytest.mark.parametrize(("f_n", "gain"), [(1.0, 0.05), pytest.param(2.0, 0.1, marks=pytest.mark.nightly)])
def test_a_slow_part_beside_a_fast_loop_is_found(f_n: float, gain: float) -> None:
    """Feed-forward beside a slow integrator: a lag, or a mode that rings, left six tenths of the servo error."""
    x_d, truth = moves(8000), ModalModel([mode(60.0, 0.6, 1.0 - gain, 1.1), mode(f_n, 1.0, gain)], dead_time=1)
    x = measured(truth, rubbed(x_d, 20e-6), "foh", 5e-7)
    found = identify_operation([(x_d, x)], T_S, order_max=4)
    assert found.rms < 0.15 * np.std(x - x_d)
    assert min(one.f_n for one in found.model.modes) == pytest.approx(f_n, rel=0.25)


@pytest.mark.slow
def test_a_flexible_mode_beside_a_velocity_loop_with_integrator_is_found() -> None:
    """Three poles of the loop and two of the mode."""
    truth = ModalModel([mode(21.0, 0.03, 0.1), mode(23.0, 1.5, 1.9), lag_mode(0.06, -1.0)], dead_time=1)
    x_d = moves(6000)
    found = identify_operation([(x_d, measured(truth, rubbed(x_d, 5e-6), "foh", 5e-7))], T_S, order_max=5)
    assert found.structure.startswith("2 modes and lag")


@pytest.mark.slow
def test_a_slow_part_is_taken_where_it_repeats_though_its_fast_pole_is_not_known() -> None:
    """A harmonic drive whose motor follows within a sample: its poles were refused, and a lag left seven tenths."""
    x_d, truth = moves(8000), ModalModel([lag_mode(1.6e-4, 0.94), lag_mode(1.0 / (3.4 * np.pi), 0.06)])
    x = measured(truth, rubbed(x_d, 20e-6), "foh", 5e-7)
    assert identify_operation([(x_d, x)], T_S, order_max=3).rms < 0.25 * np.std(x - x_d)


def test_slow_parts_that_cancel() -> None:
    assert slow_parts([mode(35.0, 0.3, 0.96), mode(3.0, 0.7, 0.04)]) == [3.0]
    assert slow_parts([mode(35.0, 0.3, 0.6), mode(3.0, 0.7, 0.4)]) == []
    assert slow_parts([mode(35.0, 0.3, 1.0), mode(3.0, 0.7, 0.0, 0.5)]) == []  # a resonance of its own
    assert slow_parts([mode(35.0, 0.3, 0.9), mode(60.0, 0.02, 0.1)]) == []
    assert slow_parts([lag_mode(5e-3)]) == []
    # (s + 21)/(s + 20) times a lag of 200 1/s, as one over-damped mode; without the zero it is slow by itself
    omega, zeta = np.sqrt(20.0 * 200.0), 220.0 / (2 * np.sqrt(20.0 * 200.0))
    f_n, gain = omega / (2 * np.pi), omega**2
    assert slow_parts([Mode(f_n, zeta, gain, gain / 21.0)]) == pytest.approx([20.0 / (2 * np.pi)])
    assert slow_parts([Mode(f_n, zeta, gain, 0.0)]) == []


def test_a_mode_that_the_log_does_not_resolve_is_not_chosen() -> None:
    """With fewer than four samples a period a replay of the log would be refused."""
    x_d = moves(2000)
    fast = ModalModel([Mode(330.0, 0.05, (660 * np.pi) ** 2)])
    found = identify_operation([(x_d, measured(fast, x_d, "foh", 1e-8))], T_S, order_max=2)
    assert all(mode.zeta >= 1.0 or mode.f_n <= 0.25 / T_S for mode in found.model.modes)


@pytest.mark.slow
def test_a_recording_that_rests_most_of_the_time_is_used() -> None:
    x_d = np.concatenate((np.zeros(3000), moves(600), np.full(3000, moves(600)[-1])))
    x = measured(LAG, x_d, "zoh", 1e-6)
    found = identify_operation([(x_d, x)], T_S, order_max=1)
    assert "moves in" in " ".join(found.findings)
    assert value(found, "lag.tau")[0] == pytest.approx(8e-3, rel=0.01)


@pytest.mark.slow
def test_missing_measurements_are_left_out() -> None:
    """What is interpolated over a stretch in motion is wrong by up to millimetres."""
    x_d = moves(2000)
    x = measured(SECOND, x_d, "foh", 1e-6)
    whole = identify_operation([(x_d, x)], T_S, order_max=2)
    fast = int(np.argmax(np.abs(np.gradient(x_d))))
    x[np.random.default_rng(1).integers(0, len(x), 60)] = np.nan
    x[fast - 30 : fast + 30] = np.nan
    found = identify_operation([(x_d, x)], T_S, order_max=2)
    assert found.structure == whole.structure
    assert found.n_samples == np.count_nonzero(~np.isnan(x))
    assert found.rms == pytest.approx(1e-6, rel=0.05)
    f_n, std = value(found, "mode[1].f_n")
    assert abs(f_n - 20.0) < 4 * std
    assert std == pytest.approx(value(whole, "mode[1].f_n")[1], rel=0.3)


@pytest.mark.slow
def test_pieces_between_gaps_count_together_and_those_of_few_samples_do_no_harm() -> None:
    x_d = moves(2000)
    x = measured(SECOND, x_d, "foh", 1e-6)
    ends = [2, 4, 6, 13, 30, 41, 44, 900, 1000, len(x_d)]
    x[900:1000] = np.nan
    pieces = [(x_d[i:j], x[i:j]) for i, j in zip([0, *ends], ends, strict=False)]
    found = identify_operation(pieces, T_S, order_max=2)
    f_n, std = value(found, "mode[1].f_n")
    assert abs(f_n - 20.0) < 4 * std
    assert found.n_samples == 1900


def test_an_initial_state_that_shows_nowhere_explains_nothing() -> None:
    ones = np.ones((3, 1))
    np.testing.assert_array_equal(without(np.zeros((3, 1)), ones), ones)
    np.testing.assert_allclose(without(np.column_stack((ones, np.zeros(3))), ones), 0.0 * ones, atol=1e-15)


@pytest.mark.parametrize("unit_gain", [True, False])
@pytest.mark.parametrize(("n_modes", "lag"), [(0, True), (1, False), (2, True)])
def test_the_derivatives_are_those_of_the_residual(n_modes: int, lag: bool, unit_gain: bool) -> None:
    x_d, structure = moves(900), Structure(n_modes, lag=lag, zero=True, unit_gain=unit_gain)
    x = np.where(np.arange(900) // 30 == 4, np.nan, measured(SECOND, x_d, "foh", 1e-6))
    pieces = [(x_d[:400], x[:400]), (x_d[400:], x[400:])]
    problem = Problem(as_segments(pieces), T_S, structure, Delay(1), 4000)
    theta = np.log([150.0, 0.5, 400.0, 0.1][: 2 * n_modes] + [90.0] * lag)
    steps = 1e-5 * np.eye(len(theta))
    ahead, back = ([problem.solve(theta + sign * step).residual for step in steps] for sign in (1, -1))
    slopes = (np.stack(ahead) - np.stack(back)) / 2e-5
    np.testing.assert_allclose(problem.jacobian(theta).T, slopes, atol=1e-5 * np.abs(slopes).max())


def test_too_many_missing_measurements_are_refused() -> None:
    x_d = moves(2000)
    x = measured(SECOND, x_d, "foh", 1e-6)
    x[200:] = np.nan
    with pytest.raises(IdentificationError, match="too many measured positions are missing: 200 are left in the part"):
        identify_operation([(x_d, x)], T_S)


def test_the_parts_with_most_motion_are_taken_of_a_long_recording() -> None:
    x_d = np.concatenate((moves(12_000), np.full(90_000, moves(12_000)[-1])))
    segments = as_segments([(x_d, x_d)])
    assert sum(len(segment.u) for segment in segments) <= 60_000
    assert sum(float(segment.motion[-1]) for segment in segments) > 0.99 * float(np.abs(np.diff(x_d)).sum())


@pytest.mark.slow
def test_a_static_gain_is_said_with_the_digits_that_are_known() -> None:
    x_d = moves(1500)
    x = 0.9 * measured(SECOND, x_d, "foh", 1e-6)
    free = identify_operation([(x_d, x)], T_S, order_max=2)
    assert free.model.dc_gain == pytest.approx(0.9, abs=1e-4)
    [gain] = [one for one in free.findings if one.startswith("the static gain is ")]
    figure, _, std = gain.removeprefix("the static gain is ").partition(" ± ")
    decimals = len(figure.partition(".")[2])
    assert 10 ** (1 - decimals) <= float(std) < 10 ** (2 - decimals)  # no digit that the deviation does not know


@pytest.mark.slow
def test_deviations_hold_for_a_residual_that_is_not_white() -> None:
    x_d = moves(3000)
    x = measured(LAG, x_d)
    structure, delay = Structure(0, lag=True), Delay(7)
    found, stated, effective = [], [], []
    for seed in range(30):
        segments = as_segments([(x_d, x + correlated(len(x), 5e-6, seed))])
        fit = fit_structure(segments, T_S, structure, delay, [np.log([100.0])], 1.0)
        parameters, n_effective = estimates(fit, segments, T_S)
        found.append(parameters[1].value)
        stated.append(parameters[1].std)
        effective.append(n_effective)
    assert 0.6 < np.median(stated) / np.std(found) < 1.5
    assert np.median(effective) < 0.1 * len(x)


X_D = moves(1500)


@pytest.mark.parametrize(
    ("x_d", "x", "reason"),
    [
        (np.full(500, 0.1), X_D[:500], "commanded position does not move"),
        (X_D, np.zeros(len(X_D)), "measured position does not move"),
        (X_D[:60], X_D[:60], "it has 60 samples"),
    ],
    ids=["rest", "stuck", "short"],
)
def test_what_trains_nothing_is_refused(x_d: Array, x: Array, reason: str) -> None:
    with pytest.raises(IdentificationError, match=f"cannot determine a model, because .*{reason}"):
        identify_operation([(x_d, x)], T_S)


@pytest.mark.slow
def test_too_little_motion_gives_a_gain_of_one() -> None:
    x_d = moves(1500) * 2e-4
    found = identify_operation([(x_d, measured(SECOND, x_d, "foh", 5e-7))], T_S, order_max=1)
    assert found.structure == "gain alone, gain 1"
    assert "too little motion" in found.findings[0]
    assert " µm of the measured one" in found.findings[0]
    turned = identify_operation([(x_d, measured(SECOND, x_d, "foh", 5e-7))], T_S, unit="rad", order_max=1)
    assert " µrad of the measured one" in turned.findings[0]
    assert turned.parameters[-1].unit == turned.unit == "rad"
    np.testing.assert_allclose(measured(found.model, x_d, found.input_hold), x_d, atol=1e-8)
    # of an axis that friction holds, too: plans by a thirtieth of the motion would ask for thirty times of it
    held = identify_operation([(moves(2000), 0.03 * measured(LAG, moves(2000)))], T_S)
    assert (held.structure, TOO_LITTLE in held.findings[0]) == ("gain alone, gain 1", True)


def test_the_last_resort_follows_its_command() -> None:
    found = unit_gain_model(T_S, "nothing moved")
    assert found.findings == ("nothing moved",)
    np.testing.assert_allclose(measured(found.model, X_D, found.input_hold), X_D, atol=1e-5)


def half(name: str) -> tuple[Array, Array, float]:
    columns = np.load(RECORDINGS / f"{name}.npz")
    return columns["x_d"], columns["x"], 0.002 if name.startswith("cnc") else 0.0053


def physics_error(found: IdentifiedModel, x_d: Array, x: Array) -> float:
    """Return the RMS error of the physics model on the second half, m."""
    discrete = found.model.discretise(found.T_s, found.input_hold)
    x_pb = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0] + x_d[0]
    return float(np.sqrt(np.mean((x - x_pb)[len(x) // 2 :] ** 2)))


@pytest.mark.slow
@pytest.mark.skipif(not EMPS.is_file(), reason=f"the recorded axis is not at {EMPS}")
def test_the_recorded_axis_is_predicted() -> None:
    """At most 7.2 µm on the second half, where the published constants leave 15.4."""
    data = io.loadmat(EMPS)
    x_d, x = data["qg"].ravel(), data["qm"].ravel()
    n = len(x) // 2
    found = identify_operation([(x_d[:n], x[:n])], 1e-3, order_max=2)
    assert physics_error(found, x_d, x) < 6.65e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("cnc_a_axis2", 1.6e-6),
        *(pytest.param(*case, marks=pytest.mark.nightly) for case in (("cnc_a_axis1", 48e-6), ("xl330_kp200", 0.19))),
    ],
)
def test_recordings_get_a_model(name: str, limit: float) -> None:
    x_d, x, T_s = half(name)
    n = len(x) // 2
    found = identify_operation([(x_d[:n], x[:n])], T_s)
    assert physics_error(found, x_d, x) < limit
