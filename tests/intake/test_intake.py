"""Intake: faults are found and named, good logs are not accused, fixes put logs right."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from places import EMPS, RECORDINGS
from spoiled_logs import FAULTS, GOOD, good, log_of

from hybridsep import ModalModel, Mode, load_machine
from hybridsep.intake.check import apply, check
from hybridsep.intake.finding import HOPELESS, NAMES, Finding
from hybridsep.intake.relation import shifted
from hybridsep.logs.log import Log, read_log

SPOILED = ("staircase", pytest.param("cnc_a_axis2.csv", marks=pytest.mark.nightly))
"""Logs that every fault is made in."""

MACHINES = {"staircase": "spring_mass_damper", "stage x": "als25010_x", "EMPS": "emps"}


def by_day(name: str) -> Any:
    """Return a log's name as a parameter: of the simulated stage one axis by day, of the random drives one."""
    alike = name == "stage y" or (name.startswith("random drive") and name != "random drive 3")
    return pytest.param(name, marks=[pytest.mark.nightly] if alike else [])


def needed(name: str) -> Log:
    if (name == "EMPS" and not EMPS.is_file()) or (name.endswith((".csv", ".json")) and not RECORDINGS.is_dir()):
        pytest.skip("needs ../shared/data beside the repository")
    return good(name)


def names(findings: tuple[Finding, ...]) -> list[str]:
    return [finding.name for finding in findings]


@pytest.mark.slow
@pytest.mark.parametrize("name", [by_day(name) for name in GOOD])
def test_a_good_log_is_not_accused(name: str) -> None:
    log = needed(name)
    machine = load_machine(MACHINES[name]) if name in MACHINES else None
    assert check(log, machine).findings == ()
    if machine is not None:
        assert check(log).findings == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", SPOILED)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_and_named(name: str, fault: str) -> None:
    expected, spoil = FAULTS[fault]
    found = check(spoil(needed(name))).findings
    assert expected in names(found)
    for finding in found:
        assert finding.name in NAMES
        assert finding.severity in ("error", "warning", "note")
        assert all(np.isfinite(value) for value in finding.evidence.values())
        assert all(len(x) == len(y) > 0 for x, y in finding.picture.lines.values())
        late = finding.name == "delay" and finding.evidence["delay"] > 0  # a model may have it as well
        noted = late or (finding.name == "clipped" and finding.evidence["n_stretches"] == 1)  # which may be friction
        assert (finding.fix is None) == (finding.name == HOPELESS or noted)
        assert (finding.severity == "note") == noted
        assert str(finding).startswith(f"{finding.severity}: {finding.name}: {finding.words}.")
        pickle.loads(pickle.dumps(finding))
    # A time that is taken out leaves a gap.
    assert set(names(found)) <= {expected, "gaps"} if expected == "time order" else names(found) == [expected]


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", [fault for fault, (name, _) in FAULTS.items() if name != HOPELESS and not fault.endswith("late")]
)
def test_a_fix_leaves_nothing_to_find(fault: str) -> None:
    expected, spoil = FAULTS[fault]
    log = needed("staircase")
    intake = check(spoil(log))
    assert intake.usable
    fixed = intake.fixed()
    assert expected not in names(check(fixed).findings)
    if expected in ("sign", "scale", "offset", "unit", "columns swapped"):
        np.testing.assert_allclose(fixed.x_meas, log.x_meas, atol=2e-3 * np.ptp(log.x_d))
        np.testing.assert_allclose(fixed.x_d, log.x_d, rtol=1e-12)
    if expected == "outliers":
        assert np.abs(fixed.x_meas - log.x_meas).max() < 3e-4
    if expected == "delay":
        assert np.abs(fixed.x_meas - np.interp(fixed.t, log.t, log.x_meas)).max() < 2e-4


def test_one_column_for_both_positions_is_found() -> None:
    log = needed("staircase")
    intake = check(replace(log, x_meas=log.x_d))
    assert names(intake.findings) == ["same column"]
    assert intake.errors
    assert not intake.usable


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("delay", [pytest.param(10.0, marks=pytest.mark.nightly), 6.5, -8.0])
def test_a_delay_is_measured_against_the_model(name: str, delay: float) -> None:
    log = needed(name)
    (finding,) = check(replace(log, x_meas=shifted(log.x_meas, delay)), load_machine(MACHINES[name])).findings
    assert finding.name == "delay"
    assert finding.evidence["delay"] == pytest.approx(delay, abs=0.6)


def test_a_resonance_behind_a_servo_is_not_shifted() -> None:
    """A servo of 20 Hz moves a load of 12 Hz: 6.6 samples beyond one mode, and no delay at all."""
    T_s, numbers = 2e-3, np.random.default_rng(3)
    moves = [np.linspace(a, b, 300) for a, b in itertools.pairwise(numbers.uniform(0.0, 1.5, 30))]
    corners = np.concatenate([np.concatenate((move, np.full(100, move[-1]))) for move in moves])
    x_d = np.convolve(np.pad(corners, 30, mode="edge"), np.full(61, 1 / 61), "valid")
    x = x_d
    for f_n, zeta in ((20.0, 0.8), (12.0, 0.05)):
        discrete = ModalModel([Mode(f_n, zeta, (2 * np.pi * f_n) ** 2)]).discretise(T_s, "foh")
        x = x[0] + discrete.forced_response(discrete.rest(), x - x[0])[0]
    log = replace(log_of(x_d, x + numbers.normal(0.0, 5e-6, len(x)), T_s), unit="rad", unit_stated=True)
    intake = check(log)
    assert [(finding.name, finding.severity) for finding in intake.findings] == [("delay", "note")]
    assert intake.fixed() is log
    assert "or another mode, which the log alone cannot tell apart" in intake.findings[0].words


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["flipped", "offset of a third", "slow sensor", "five spikes", "10 samples late"])
@pytest.mark.parametrize("scale", [1e-4, pytest.param(30.0, marks=pytest.mark.nightly)])
def test_findings_do_not_depend_on_the_scale(fault: str, scale: float) -> None:
    """Only the unit is a matter of scale, and it is not if it is stated."""
    spoiled = FAULTS[fault][1](needed("staircase"))
    other = replace(spoiled, x_d=scale * spoiled.x_d, x_meas=scale * spoiled.x_meas, unit_stated=True)
    for one, same in zip(check(spoiled).findings, check(other).findings, strict=True):
        assert one.name == same.name


@pytest.mark.slow
def test_several_faults_at_once() -> None:
    log = needed("staircase")
    spoiled = log
    for fault in ("five spikes", "flipped", "mm for m", "rows lost"):
        spoiled = FAULTS[fault][1](spoiled)
    intake = check(spoiled)
    assert names(intake.findings) == ["gaps", "outliers", "sign", "scale"]
    assert len(intake.fixed().segments()) == 2  # 40 rows are a gap, 7 are missing measurements
    assert len(check(spoiled, bridged=0).fixed().segments()) == 3
    some = apply(spoiled, intake.findings[:1])
    assert names(check(some).findings) == ["missing samples", "outliers", "sign", "scale"]


def test_what_no_fix_helps() -> None:
    still = check(FAULTS["no motion"][1](needed("staircase")))
    assert not still.usable
    assert still.errors == ()
    assert "the command never moves: this log cannot determine a model" in still.findings[0].words
    log = needed("staircase")
    another = check(replace(log, x_meas=np.cumsum(np.random.default_rng(1).normal(0.0, 1e-4, len(log.t)))))
    assert "hardly follows the command" in another.findings[0].words
    assert not another.usable


def test_missing_measurements() -> None:
    log = needed("staircase")
    x = log.x_meas.copy()
    x[500:520] = np.nan
    (finding,) = check(replace(log, x_meas=x)).findings
    assert (finding.name, finding.severity) == ("missing samples", "note")
    assert "20 of 6001 measured positions are missing; the first is sample 501" in finding.words
    assert np.isfinite(apply(replace(log, x_meas=x), [finding]).x_meas).all()
    nothing = check(replace(log, x_meas=np.full_like(x, np.nan)))
    assert "every measured position is missing" in nothing.findings[0].words


def test_short_gaps_are_bridged() -> None:
    log = needed("staircase")
    numbers = np.random.default_rng(3)
    keep = np.ones(len(log.t), dtype=np.bool_)
    keep[numbers.integers(20, len(log.t) - 20, 40)] = False
    keep[2050:2060] = False  # in motion
    holed = replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=log.x_meas[keep])
    [finding] = check(holed).findings
    assert finding.name == "gaps"
    assert finding.evidence["n_lost"] == np.count_nonzero(~keep)
    assert finding.evidence["n_bridged"] == finding.evidence["n"]
    fixed = apply(holed, [finding])
    assert len(fixed.segments()) == 1
    np.testing.assert_allclose(fixed.t, log.t, atol=1e-12)
    np.testing.assert_array_equal(np.isnan(fixed.x_meas), ~keep)
    np.testing.assert_array_equal(fixed.x_meas[keep], log.x_meas[keep])
    np.testing.assert_array_equal(fixed.x_d[keep], log.x_d[keep])
    assert np.abs(fixed.x_d - log.x_d).max() < 1e-4 * np.ptp(log.x_d)
    assert names(check(fixed).findings) == ["missing samples"]
    assert len(check(holed, bridged=0).fixed().segments()) > 30
    keep[4000:4011] = False
    longer = replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=log.x_meas[keep])
    [finding] = check(longer).findings
    assert finding.fix is not None
    assert finding.fix.words.endswith(
        "where at most 10 samples are missing, and keep the segments apart at longer ones"
    )
    assert [len(segment.t) for segment in apply(longer, [finding]).segments()] == [4000, len(log.t) - 4011]


def test_missing_measurements_and_rows_are_told_apart() -> None:
    log = needed("staircase")
    x = log.x_meas.copy()
    x[500] = np.nan
    keep = np.arange(len(x)) != 700
    missing, gap = check(replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=x[keep])).findings[::-1]
    assert (gap.name, missing.name) == ("gaps", "missing samples")
    assert gap.words.startswith("1 sample is missing in 1 gap of 0.002 s; the first is before sample 701")
    assert missing.words.startswith("1 of 6000 measured positions is missing; the first is sample 501")
    fixed = apply(replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=x[keep]), [gap])
    assert np.flatnonzero(np.isnan(fixed.x_meas)).tolist() == [500, 700]


@pytest.mark.slow
def test_words() -> None:
    log = needed("staircase")

    def words(fault: str) -> str:
        return str(check(FAULTS[fault][1](log)).findings[0])

    assert "the measured position moves opposite to the command (gain -0.999" in words("flipped")
    assert "999.143 times the commanded one: measured in mm, commanded in m. Fix: multiply" in words("mm for m")
    assert "is +249.989 mm away from the commanded one throughout, 8.3 of the travel" in words("offset of 0.25 m")
    assert "47 samples are missing in 2 gaps, the longest of 0.041 s; the first is before sample 201" in words(
        "rows lost"
    )
    assert "note: delay: the measured position lags 9.9 samples (9.91 ms) beyond what one mode" in words(
        "10 samples late"
    )
    assert "Fix" not in words("10 samples late")
    assert "is recorded 8.1 samples (8.09 ms) too early" in words("8 samples early")
    assert "Fix: shift the measured position by +8" in words("8 samples early")
    late = replace(log, x_meas=shifted(log.x_meas, 10.0))
    (finding,) = check(late, load_machine("spring_mass_damper")).findings
    assert "; where the controller gets it as late, say so to the predictor: " in str(finding)
    assert "measurement_delay = 10, which replaces as much of the model's dead_time (never both)" in str(finding)


def test_a_flicker_at_rest_is_no_motion() -> None:
    """A command in counts that rests, and flickers by one, before it moves by three a sample."""
    steps = np.concatenate((np.tile([1.0, -1.0], 200), np.tile([3.0, 2.0], 400), np.zeros(300)))
    x_d = 1e-6 * np.cumsum(np.concatenate(([0.0], steps)))
    assert "start in motion" not in names(check(log_of(x_d, shifted(x_d, 2.0))).findings)
    moving = log_of(x_d[450:], shifted(x_d, 2.0)[450:])
    (finding,) = [finding for finding in check(moving).findings if finding.name == "start in motion"]
    assert "is estimated from its first samples" in finding.words


def test_an_applied_fix_says_so() -> None:
    log = needed("staircase")
    for fault, words in (("rows lost", "handled: gaps: "), ("flipped", "fixed: sign: ")):
        (finding,) = check(FAULTS[fault][1](log)).findings
        assert str(finding).startswith("error: ")
        done = str(replace(finding, applied=True))
        assert done.startswith(words)
        assert "Done: " in done
        assert ("your controller must do the same" in done) == (fault == "flipped")


def test_sampling_rate_against_the_machine() -> None:
    machine = load_machine("spring_mass_damper")
    log = needed("staircase")
    slow = log_of(log.x_d[::20], log.x_meas[::20], 0.02)
    (finding,) = [finding for finding in check(slow, machine).findings if finding.name == "sampling rate"]
    assert (finding.severity, finding.fix) == ("error", None)
    assert "has 2 samples a period of the machine's mode at 25 Hz" in finding.words
    half = log_of(log.x_d[::2], log.x_meas[::2], 0.002)
    (finding,) = [finding for finding in check(half, machine).findings if finding.name == "sampling rate"]
    assert "sampled every 0.002 s, the machine file says T_s = 0.001 s" in finding.words
    assert finding.fix is not None
    assert finding.fix.change(half).T_s == 0.001
    assert len(finding.fix.change(half).t) == len(log.t)


def turning(speed: float = 30.0) -> Log:
    """A rotary axis of 15 Hz that turns and rests, from rest at 0, at most with that speed, rad/s."""
    levels = np.repeat([0.0, 1.0, 0.0, -0.6, 0.0, 0.8, 0.0], [200, 1500, 200, 1500, 300, 1500, 300])
    velocity = np.convolve(np.pad(speed * levels, 30, mode="edge"), np.full(61, 1 / 61), "valid")
    x_d = 1e-3 * np.cumsum(velocity)
    discrete = ModalModel([Mode(15.0, 0.5, (30 * np.pi) ** 2)]).discretise(1e-3, "zoh")
    x = discrete.forced_response(discrete.rest(), x_d)[0] + np.random.default_rng(4).normal(0.0, 2e-5, len(x_d))
    return replace(log_of(x_d, x), unit="rad", unit_stated=True)


TURN = 2 * np.pi


@pytest.mark.parametrize("low", [0.0, -np.pi])
@pytest.mark.parametrize("columns", [("x_d", "x_meas"), ("x_d",), ("x_meas",)])
def test_whole_turns_are_unwrapped(low: float, columns: tuple[str, ...]) -> None:
    """Modulo 360 deg, at 0 the noise alone wraps the measurement: that was taken for outliers, and interpolated."""
    log = turning()
    wrapped = replace(log, **{name: np.mod(getattr(log, name) - low, TURN) + low for name in columns})
    intake = check(wrapped)
    (finding,) = intake.findings
    assert (finding.name, finding.severity) == ("whole turns", "error")
    assert "360 deg" in finding.words
    fixed = intake.fixed()
    np.testing.assert_allclose(fixed.x_d, log.x_d, atol=1e-9)
    np.testing.assert_allclose(fixed.x_meas, log.x_meas, atol=1e-9)


def test_what_is_no_wrapping_is_not_unwrapped() -> None:
    log = turning()
    assert check(log).findings == ()
    linear = replace(log, unit="m", x_d=np.mod(log.x_d, TURN), x_meas=np.mod(log.x_meas, TURN))
    assert "whole turns" not in names(check(linear).findings)
    # One turn commanded in a step, which the axis makes in half a second, is a motion.
    step = np.where(np.arange(4000) // 1000 % 2 == 1, TURN, 0.0)
    slow = ModalModel([Mode(2.0, 0.9, (4 * np.pi) ** 2)]).discretise(1e-3, "zoh")
    turned = replace(log_of(step, slow.forced_response(slow.rest(), step)[0]), unit="rad", unit_stated=True)
    assert "whole turns" not in names(check(turned).findings)
    spiky = FAULTS["thirty large spikes"][1](replace(log, x_d=log.x_d / 30, x_meas=log.x_meas / 30))
    assert names(check(spiky).findings) == ["outliers"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [by_day(name) for name in ("staircase", *(f"random drive {i}" for i in (3, 15, 33)))])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_following_error_is_no_velocity(name: str, sign: float) -> None:
    log = needed(name)
    intake = check(replace(log, x_meas=sign * (log.x_d - log.x_meas)))
    finding = intake.findings[0]
    assert (finding.name, finding.severity) == ("following error", "error")
    assert finding.fix is not None
    assert ("x = x_d − x" in finding.fix.words) == (sign > 0)
    np.testing.assert_allclose(intake.fixed().x_meas, log.x_meas, atol=1e-12)


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/data/recordings beside the repository")
def test_a_recording_with_an_uneven_clock() -> None:
    log = read_log(RECORDINGS / "xl330_kp100_raw_jitter.csv", uniform=False)
    intake = check(log)
    assert names(intake.findings) == ["jitter", "start in motion"]
    fixed = intake.fixed()
    np.testing.assert_allclose(np.diff(fixed.t), log.T_s)
    assert "jitter" not in names(check(fixed).findings)


ODD: tuple[Callable[[int, np.random.Generator], ArrayLike], ...] = (
    lambda n, _: np.zeros(n),
    lambda n, numbers: numbers.normal(size=n),
    lambda n, numbers: np.round(np.cumsum(numbers.normal(size=n))),
    lambda n, _: np.sin(np.arange(n) / 7),
    lambda n, _: (np.arange(n) % 50 > 25) * 1.0,
    lambda n, numbers: 1e3 * np.sign(numbers.normal(size=n)),
    lambda n, numbers: 5e-324 * numbers.integers(0, 9, n),
    lambda n, _: np.r_[np.zeros(n - 1), 1.0],
)


@pytest.mark.parametrize("seed", range(40))
def test_odd_logs_are_checked_and_fixed_without_an_error(seed: int) -> None:
    numbers = np.random.default_rng(seed)
    n = int(numbers.choice([2, 3, 9, 60, 300]))
    x_d, x = (np.asarray(ODD[i](n, numbers), dtype=np.float64) for i in numbers.integers(0, len(ODD), 2))
    log = log_of(x_d, np.where(numbers.random(n) < 0.05 * (seed % 2), np.nan, x))
    if seed % 3 == 0:
        log = replace(log, t=log.t + numbers.normal(size=n) * 1e-3)
    intake = check(log, load_machine("emps"))
    fixed = intake.fixed()
    assert len(fixed.t) == len(fixed.x_d) == len(fixed.x_meas) > 0
    assert sum(len(segment.t) for segment in fixed.segments()) == len(fixed.t)
    if n < 200:
        assert "too little motion" in names(intake.findings)
