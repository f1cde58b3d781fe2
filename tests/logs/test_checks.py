"""Checks of logs: good ones are neither altered nor refused, columns that mean something else are."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from log_files import write
from places import CASES, RECORDINGS
from properties import examples
from random_drives.drive import Draws
from scipy.signal import chirp, lfilter
from two_mass.commands import KINDS as COMMANDS
from two_mass.commands import Dynamics

from hybridsep import ModalModel, Mode, load_machine, simulate, spiral
from hybridsep.base.errors import LogError
from hybridsep.base.signals import Array
from hybridsep.logs.checks import check, checked, moved_by_command
from hybridsep.logs.log import Log, read_log

GOOD_CASES = CASES.parent / "good"

RECORDED = [*sorted(RECORDINGS.glob("*.npz")), *sorted(GOOD_CASES.glob("*.npz"))]


def names(log: Log) -> list[str]:
    """Return what a log is refused for."""
    return [one.name for one in check(log) if one.refused]


# Random good logs of simulated axes: kinds of drives, of commands and of encoders, each a pure function of a seed


_N = 3000  # samples of a log

Numbers = np.random.Generator


def log_of(x_d: Array, x_meas: Array, T_s: float = 1e-3) -> Log:
    return Log(T_s * np.arange(len(x_d), dtype=np.float64), x_d, x_meas, T_s, Path("log.csv"))


def _commands(kind: str, draws: Draws, T_s: float) -> Array:
    """Return commands of a kind that rest at first, m."""
    return np.pad(COMMANDS[kind](draws, Dynamics.draw(draws, 0.5), _N, T_s), (100, 0), mode="edge")


DRIVES = ("lag", "mode", "load on a spring", "fed forward", "under load", "play")


def _modes(x_d: Array, T_s: float, modes: list[Mode], dead_time: int) -> Array:
    discrete = ModalModel(modes, dead_time).discretise(T_s, "zoh")
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


def _driven(drive: str, numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    """Return the measured positions without an encoder."""
    omega, zeta, u = 2 * np.pi * f, float(numbers.uniform(0.15, 1.2)), float(numbers.uniform())
    modes = [Mode(f, zeta, omega**2)]
    if drive in ("lag", "play"):
        modes = [Mode(f, 1.0, omega**2, omega)]
    elif drive == "fed forward":
        modes = [Mode(f, max(zeta, 0.3), omega**2, (1 + u) * max(zeta, 0.3) * omega)]
    elif drive == "load on a spring":
        share, other = 0.05 + 0.35 * u, omega * float(numbers.uniform(1.3, 2.5))
        modes = [Mode(f, max(zeta, 0.5), (1 - share) * omega**2), Mode(other / (2 * np.pi), 0.08, share * other**2)]
    if drive == "play":
        half, last = 0.5 * (0.002 + 0.048 * u) * float(np.ptp(x_d)), float(x_d[0])
        x_d = x_d.copy()
        for k, value in enumerate(x_d.tolist()):
            x_d[k] = last = min(max(last, value - half), value + half)
    x = _modes(x_d, T_s, modes, int(numbers.integers(0, 3)))
    return x_d[0] + (0.2 + 0.8 * u) * (x - x_d[0]) if drive == "under load" else x


def generated_log(seed: int) -> Log:
    """Return the good log of a seed; 36 seeds in a row have every command with every drive."""
    draws, numbers = Draws(21, seed), np.random.default_rng([21, seed])
    T_s = draws.choice((0.5e-3, 1e-3, 2e-3, 5e-3))
    f = draws.uniform(0.006, 0.05) / T_s  # 20 to 160 samples a period
    x_d = _commands(tuple(COMMANDS)[seed % len(COMMANDS)], draws, T_s)
    rotary = draws.chance(0.3)
    travel = draws.choice((0.2, 3.0, 40.0) if rotary else (1e-3, 0.03, 0.4))
    x_d = travel * x_d / float(np.ptp(x_d))
    if draws.chance(0.5):
        x_d = 1e-6 * travel * np.round(x_d / (1e-6 * travel))
    x = _driven(DRIVES[seed // len(COMMANDS) % len(DRIVES)], numbers, x_d, f, T_s)
    x = x + draws.choice((0.0, 1e-6, 1e-4)) * travel * draws.normal(len(x))
    count = draws.choice((0.0, 1e-6, 1e-4, 5e-4)) * travel
    x = count * np.round(x / count) if count else x
    return replace(log_of(x_d, x, T_s), unit="rad" if rotary else "m", unit_stated=True)


def _resting_axis() -> Log:
    """A smooth command that dies away, and an axis 4 ms behind it whose encoder soon shows rest."""

    def command(t: Array) -> Array:
        t = np.where(t > 0.0, t, 0.0)
        return np.asarray(0.05 * np.exp(-t) * np.sin(2 * np.pi * 3.0 * t) ** 2)

    t = np.asarray(1e-2 * np.arange(2000), dtype=np.float64)
    return log_of(command(t - 1.0), 1e-5 * np.round(command(t - 1.004) / 1e-5), 1e-2)


def _reaches_a_share(share: float) -> Log:
    """A position loop without integrator against a spring."""
    numbers, x_d = np.random.default_rng(69), _commands("moves", Draws(69), 5e-3)
    x_d = 0.8 * x_d / float(np.ptp(x_d))
    x = share * _modes(x_d, 5e-3, [Mode(4.0, 0.7, (8 * np.pi) ** 2)], 1) + 1e-4 * numbers.normal(size=len(x_d))
    return replace(log_of(x_d, x, 5e-3), unit="rad", unit_stated=True)


def _robot_joint(times: float, dead_time: int) -> Log:
    """A joint of 3 Hz, driven ``times`` times as fast and in motion from the first sample on."""
    t, numbers = 4e-3 * np.arange(3000), np.random.default_rng(75)
    x_d = sum(a * np.sin(2 * np.pi * 3.0 * times * f * t + p) for a, f, p in ((0.3, 1.0, 0.4), (0.1, 1.13, 2.0)))
    x = _modes(np.asarray(x_d), 4e-3, [Mode(3.0, 0.15, (6 * np.pi) ** 2)], dead_time)
    return replace(log_of(np.asarray(x_d), x + 1e-4 * numbers.normal(size=len(t)), 4e-3), unit="rad", unit_stated=True)


ACCUSED_BEFORE: dict[str, Callable[[], Log]] = {
    "a smooth command, a resting axis": _resting_axis,
    **{f"a servo that reaches {share:g}": partial(_reaches_a_share, share) for share in (0.2, 0.45, 0.69)},
    **{
        f"a robot joint at {times:g} times its bandwidth, {late} late": partial(_robot_joint, times, late)
        for times, late in ((1.5, 0), (1.5, 2), (2.5, 1))
    },
}
"""Good logs by name that were refused: as swapped, for their scale, for their sign."""


# Good logs


@pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)
def test_a_recorded_log_is_taken_as_it_is(path: Path) -> None:
    log = read_log(path)
    assert names(log) == []
    if "hej90" in path.stem:  # whose sensor is renewed every 15 ms
        assert (len(log.t), log.T_s) == (745, 0.015)
        return
    columns = np.load(path)
    np.testing.assert_array_equal([log.x_d, log.x_meas], [columns["x_d"], columns["x"]])
    assert (log.starts, log.remarks) == ((0,), ())


@pytest.mark.parametrize("first", [0, 36, pytest.param(72, marks=pytest.mark.nightly)])
def test_simulated_axes_are_not_refused(first: int) -> None:
    for seed in range(first, first + 36):
        assert names(generated_log(seed)) == [], seed


@pytest.mark.parametrize("name", ACCUSED_BEFORE)
def test_a_good_log_that_was_refused(name: str) -> None:
    assert names(ACCUSED_BEFORE[name]()) == []


@pytest.mark.parametrize("axis", ["x", "y"])
def test_an_axis_without_lag_is_not_refused(axis: str) -> None:
    machine = load_machine(f"als25010_{axis}")
    x_d = spiral()[axis == "y"][:2000]
    x = simulate(machine.new_plant(), x_d, machine.T_s) + np.random.default_rng(7).normal(0.0, 1e-6, len(x_d))
    assert names(log_of(x_d, x)) == []


# What is refused


def swept() -> Log:
    t = 1e-3 * np.arange(12_000)
    x_d = 5e-4 * chirp(t, 0.5, t[-1], 80.0, phi=-90)
    lag = np.exp(-np.arange(100) / 8.0)
    x = np.convolve(x_d - x_d[0], lag / lag.sum())[: len(t)] + x_d[0]
    return log_of(x_d, x + 2e-7 * np.random.default_rng(1).normal(size=len(t)))


def early(log: Log) -> Log:
    return replace(log, t=log.t[:-15], x_d=log.x_d[:-15], x_meas=log.x_meas[15:])


def moves() -> Log:
    return generated_log(43)


def counted(x: Array) -> Array:
    """Return positions as a counter of 16 bits has them, which wraps once or twice over the travel."""
    step = float(np.ptp(x)) / 1e5
    return np.asarray(step * (np.round(x / step) % 2**16))


FAULTS: dict[str, tuple[str, Callable[[Log], Log]]] = {
    "flipped": ("sign", lambda log: replace(log, x_meas=-log.x_meas)),
    "mm for m": ("scale", lambda log: replace(log, x_meas=1e3 * log.x_meas)),
    "deg for rad": ("scale", lambda log: replace(log, x_meas=np.degrees(log.x_meas))),
    "gain of 4e-5": ("scale", lambda log: replace(log, x_meas=4e-5 * log.x_meas)),
    "swapped": ("columns swapped", lambda log: replace(log, x_d=log.x_meas, x_meas=log.x_d)),
    "8 samples early": ("columns swapped", early),
    "following error": ("following error", lambda log: replace(log, x_meas=log.x_d - log.x_meas)),
    "minus the following error": ("following error", lambda log: replace(log, x_meas=log.x_meas - log.x_d)),
    "velocity measured": ("velocity", lambda log: replace(log, x_meas=np.gradient(log.x_meas) / log.T_s)),
    "velocity commanded": ("velocity", lambda log: replace(log, x_d=np.gradient(log.x_d) / log.T_s)),
    "another axis": ("hardly follows", lambda log: replace(log, x_meas=generated_log(7).x_d)),
    "one column": ("same column", lambda log: replace(log, x_meas=log.x_d)),
    "a counter wraps": ("wraps", lambda log: replace(log, x_meas=counted(log.x_meas))),
    "no command": ("no motion", lambda log: replace(log, x_d=np.zeros_like(log.x_d))),
    "no motion": ("no motion", lambda log: replace(log, x_meas=np.zeros_like(log.x_d))),
    "short": ("too short", lambda log: log_of(log.x_d[150:240], log.x_meas[150:240], log.T_s)),
    "mm read as m": (
        "unit",
        lambda log: replace(log, x_d=1e3 * log.x_d, x_meas=1e3 * log.x_meas, unit="m", unit_stated=False),
    ),
}


def test_a_stated_unit_that_no_axis_has_is_noted() -> None:
    log = moves()
    found = check(replace(log, x_d=1e4 * log.x_d, x_meas=1e4 * log.x_meas, file_unit="mm", unit_stated=True))
    assert [(one.name, one.refused, one.options) for one in found if one.name == "unit"] == [("unit", False, ())]


OF_A_SWEPT_SINE = ("flipped", "mm for m", "deg for rad", "swapped", "following error", "one column")


@pytest.mark.parametrize(
    ("fault", "good"), [*((fault, moves) for fault in FAULTS), *((fault, swept) for fault in OF_A_SWEPT_SINE)]
)
def test_columns_that_mean_something_else_are_refused(fault: str, good: Callable[[], Log]) -> None:
    name, spoil = FAULTS[fault]
    log = spoil(good())
    assert names(log) == [name]
    with pytest.raises(LogError, match=f"log.csv: {name}: "):
        checked(log)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("kept", "name"), [("x_d", "pos_cmd"), ("x_meas", "pos_act")])
def test_an_error_tells_the_other_position(kept: str, name: str, sign: int) -> None:
    log = moves()
    table = {name: getattr(log, kept), "lag_um": 1e6 * sign * (log.x_d - log.x_meas)}
    read, (right, wrong) = partial(read_log, table, T_s=log.T_s), ("lag_um", "-lag_um")[::sign]
    found = read(columns={"error": right})
    np.testing.assert_allclose((found.x_d, found.x_meas), (log.x_d, log.x_meas), atol=1e-15)
    assert f"the other way: --error={wrong}" in found.remarks[0]
    assert read(columns=found.columns).columns == found.columns
    with pytest.raises(LogError, match=f"sign: the position that .* runs ahead: .*--error={right}"):
        checked(read(columns={"error": wrong}))
    there = read_log(
        {f"{name} [mm]": 1e3 * table[name], "lag": 1e-3 * table[wrong.strip("-")]},
        T_s=log.T_s,
        columns={"error": "lag" if sign > 0 else "-lag"},
    )  # an error without a unit has the position's
    np.testing.assert_allclose((there.x_d, there.x_meas), (log.x_d, log.x_meas), atol=1e-15)
    table["lag_um"][9] = np.nan
    with nullcontext() if kept == "x_d" else pytest.raises(LogError, match=r"sample 10 .* must be finite, got nan"):
        assert np.isnan(read(columns={"error": right}).x_meas[9])


@pytest.mark.parametrize("there", ["X_cmd X_act Y_cmd Y_act", "X_cmd - Y_cmd", "- X_act - Y_act", "- - cmd_2 ENcmd_2"])
def test_an_errors_name_chooses_the_axis(there: str) -> None:
    x_d, x = moves().x_d, moves().x_meas
    of = [x_d, x, 0.5 * x_d, 0.5 * x]
    table = {**dict(zip(there.split(), of, strict=False)), "X_err|1": x_d - x, "Y_err|2": 0.5 * (x_d - x)}
    log = read_log(table, T_s=1e-3, columns={"error": "Y_err|2"})
    np.testing.assert_allclose((log.x_d, log.x_meas), of[2:], atol=1e-15)
    for own in ({"x_d": x_d, "X1_act": x, "x": x}, {"soll": x_d, "X1_act": 2.0 * x}):  # names of no axis come first
        log = read_log({**own, "X1_err": x_d - x}, T_s=1e-3, columns={"error": "X1_err"})
        np.testing.assert_allclose((log.x_d, log.x_meas), of[:2], atol=1e-15)
    with pytest.raises(LogError, match=r"column 'Y_lag' \(error\) is missing, .*; name it: --error NAME"):
        read_log(table, T_s=1e-3, columns={"error": "Y_lag"})


def test_jumps_are_no_counter_that_wraps() -> None:
    """Steps of 65 mm and a creep, a sensor that reads 0 at 65 mm, a log that goes on elsewhere, fast returns."""
    k = np.arange(3000.0)
    steps, slow = 0.065 * (k // 500 % 2) + 1e-6 * k, 0.065 + 1e-6 * np.round(400.0 * np.sin(k / 200.0))
    there = replace(log_of(np.append(slow, slow - 0.065), np.append(slow, slow - 0.065) + 1e-6), starts=(0, 3000))
    raster = np.interp(k % 1000.0, [0.0, 980.0, 1000.0], [0.0, 0.02, 0.0])
    faulty = log_of(slow, np.where(k == 700.0, 0.0, slow + 1e-6)), log_of(slow, np.where(k % 900.0 < 5.0, 0.0, slow))
    for log in (log_of(steps, steps + 2e-6), *faulty, there, log_of(raster, raster + 1e-6)):
        assert not {"wraps", "begins anew"} & {*names(log)}


def test_a_quiet_sensors_swap_is_found_and_no_shift_is_offered() -> None:
    if not CASES.is_dir():
        pytest.skip("needs ../shared/cases beside the repository")
    log = read_log(CASES / "swap.csv.gz")
    with pytest.raises(LogError, match=r"columns swapped: x_d follows x, 7\.2 samples later") as caught:
        checked(log)
    assert [option for option, _ in caught.value.options] == ["--x_d 'x [mm]' --x 'x_d [mm]'"]
    assert names(read_log(CASES / "swap.csv.gz", columns={"x_d": "x", "x": "x_d"})) == []


def test_a_shift_is_offered_where_the_measured_column_is_the_noisier_one() -> None:
    log = early(moves())
    noise = 1e-5 * np.ptp(log.x_d) * np.random.default_rng(0).normal(size=len(log.t))
    (finding,) = check(replace(log, x_meas=log.x_meas + noise))
    assert [option for option, _ in finding.options] == ["--x_d x --x x_d", "--delay -7"]


# What is noted


NOTES: dict[str, Callable[[Log], Log]] = {
    "missing samples": lambda log: replace(log, x_meas=np.where(np.arange(len(log.t)) == 700, np.nan, log.x_meas)),
    "rate": lambda log: replace(log, t=log.t + 0.1 * log.T_s * np.sin(np.arange(len(log.t)))),
    "slow samples": lambda log: log_of(log.x_d, log.x_meas, 1.0),
    "offset": lambda log: replace(log, x_meas=log.x_meas + 0.02 * np.ptp(log.x_d)),
    "late": lambda log: replace(log, x_meas=np.concatenate((np.zeros(400), log.x_meas[:-400]))),
    "start in motion": lambda log: log_of(log.x_d[1200:] - log.x_d[1200], log.x_meas[1200:] - log.x_d[1200], log.T_s),
    "stuck samples": lambda log: replace(
        log, x_meas=np.r_[log.x_meas[:950], 60 * [log.x_meas[950]], log.x_meas[1010:]]
    ),
    "outliers": lambda log: replace(log, x_meas=log.x_meas + 0.1 * (np.arange(len(log.t)) == 500)),
    "clipped": lambda log: replace(log, x_meas=np.minimum(log.x_meas, 0.8 * float(log.x_meas.max()))),
    "moved at rest": lambda log: rested(log, 0.02),
    "begins anew": lambda _log: log_of(2e-5 * np.arange(12000.0) % 0.02, 2e-5 * np.arange(-5.0, 11995.0) % 0.02),
}


def rested(log: Log, size: float) -> Log:
    """Return a log with a rest of 1.5 s after it, in which something else moves the axis by a size, m, and back."""
    rest, push = np.full(1500, log.x_d[-1]), size * np.pad(np.hanning(600), (500, 400))
    end = log.x_meas[-1] + (rest[0] - log.x_meas[-1]) * -np.expm1(-np.arange(1500) / 6.0)
    return log_of(np.concatenate((log.x_d, rest)), np.concatenate((log.x_meas, end + push)), log.T_s)


def sines() -> Log:
    t = 1e-3 * np.arange(3000)
    x_d = 0.05 * (1.0 - np.cos(2 * np.pi * 1.3 * t)) + 0.01 * (1.0 - np.cos(2 * np.pi * 3.1 * t))
    lag = np.exp(-np.arange(60) / 6.0)
    return log_of(x_d, np.convolve(x_d, lag / lag.sum())[: len(t)])


@pytest.mark.parametrize("name", NOTES)
def test_what_is_noted_has_a_statistic_and_changes_nothing(name: str) -> None:
    found = {one.name: one for one in checked(NOTES[name](sines()))}
    assert name in found
    assert found[name].evidence
    assert name != "late" or "lags its command by 406 samples (0.406 s)" in found[name].words  # 6 of the drive
    assert str(found[name]).startswith(f"note: {name}: ")


def test_milliseconds_that_are_called_seconds_are_refused_where_nothing_states_them() -> None:
    log = NOTES["late"](sines())
    in_ms = replace(log, t=1e3 * log.t, T_s=1e3 * log.T_s)
    assert not any(one.refused for one in check(in_ms))
    (finding,) = [one for one in check(replace(in_ms, time_stated=False)) if one.refused]
    assert finding.options[0] == ("--T_s 0.001", "where times are in ms")
    assert not any(one.refused for one in check(replace(log, time_stated=False)))


def test_what_moves_an_axis_at_rest_is_not_learned() -> None:
    """Further than its error ever was in motion, until it is back: a quarter of a millimetre may be friction's."""
    log = rested(sines(), 0.02)
    gone = np.flatnonzero(np.isnan(moved_by_command(log)))
    assert (gone[0], gone[-1]) == (pytest.approx(3575, abs=75), pytest.approx(4025, abs=75))
    assert not np.isnan(moved_by_command(rested(sines(), 2.5e-4))).any()
    (note,) = [one for one in check(log) if one.name == "moved at rest"]
    assert note.evidence == {"n": 1.0, "duration": pytest.approx(1e-3 * len(gone))}
    away = replace(log, x_meas=np.concatenate((log.x_meas[:3800], np.full(700, log.x_meas[3800]))))  # not back
    assert np.isnan(moved_by_command(away)[3700:]).all()
    log.x_meas[3301] = np.nan  # among the samples that tell where it stood
    assert np.isnan(moved_by_command(log)).sum() == len(gone) + 1


def test_noise_moves_no_axis() -> None:
    """Of an axis whose error is its noise, with a longer rest than motion; and of a segment that only rests."""
    x_d = np.concatenate((sines().x_d, np.full(60_000, sines().x_d[-1])))
    log = log_of(x_d, x_d + np.random.default_rng(4).normal(0.0, 1e-6, len(x_d)))
    log.x_meas[[20_000, 50_000]] += 1e-4  # two outliers
    for one in (log, *replace(log, starts=(0, 3100)).segments()):
        assert not np.isnan(moved_by_command(one)).any()


@pytest.mark.parametrize("rest", [0.1, 0.8])
@pytest.mark.parametrize(("offset", "said"), [(0.0, False), (50e-6, False), (370e-6, True), (-370e-6, True)])
def test_an_offset_is_noted_where_the_error_varies_by_less(rest: float, offset: float, said: bool) -> None:
    """An axis of 0.16 m whose friction, 85 µm, stays at rest: a thousandth of the travel is no little offset to it."""
    numbers, x_d, friction = np.random.default_rng(5), np.empty(0), np.empty(0)
    for last, level in pairwise(numbers.uniform(0.0, 0.16, 60)):
        n = round(500 * (1.0 - rest))
        x_d = np.concatenate((x_d, np.linspace(last, level, n), np.full(500 - n, level)))
        friction = np.concatenate((friction, np.full(500, 85e-6 * np.sign(level - last))))
    x = np.pad(x_d, (3, 0), mode="edge")[: len(x_d)] - friction
    found = {one.name: one for one in check(log_of(x_d, x + offset + 1e-7 * numbers.normal(size=len(x))))}
    assert ("offset" in found) == said
    if said:
        assert found["offset"].evidence["offset"] == pytest.approx(offset, abs=90e-6)
        assert "where only the zeros differ, take the offset away" in found["offset"].words


def test_a_lag_in_one_direction_is_no_offset() -> None:
    x_d = 5e-5 * np.maximum(np.arange(4000.0) - 500.0, 0.0)
    x = lfilter([1.0 / 24.4], [1.0, -23.4 / 24.4], x_d)
    assert "offset" not in {one.name for one in check(log_of(x_d, x))}
    assert "offset" not in {one.name for one in check(log_of(x_d[500:] + 1e-3, x[500:] + 1e-3))}


def test_a_coarse_encoder_does_not_stand_behind_a_lag() -> None:
    """Moves of a few steps of the encoder after rests: a step comes late, and nothing sticks."""
    moves_of = np.repeat(np.random.default_rng(3).uniform(0.0, 20e-6, 30), 200)
    x_d = np.convolve(moves_of - moves_of[0], np.ones(12) / 12)[: len(moves_of)]
    lag = np.exp(-np.arange(60) / 8.0)
    x = np.convolve(x_d, lag / lag.sum())[: len(x_d)]
    assert not check(log_of(x_d, 1e-6 * np.round(1e6 * x)))


def test_large_outliers_are_noted_and_do_not_hide_the_axis() -> None:
    log, numbers = moves(), np.random.default_rng(7)
    x = log.x_meas.copy()
    x[20 + 100 * np.arange(28) + numbers.integers(0, 90, 28)] += 10.0 * np.ptp(log.x_d)
    x[[0, -1]] = -10.0 * np.ptp(log.x_d)  # a sensor that is not ready yet, a number that is cut off
    (finding,) = check(replace(log, x_meas=x))
    assert (finding.name, finding.refused, finding.evidence["n"]) == ("outliers", False, 30.0)


def test_numbers_without_bounds_are_checked() -> None:
    log = moves()
    assert check(replace(log, x_meas=1e300 * log.x_meas))[0].refused


# Any log


@given(
    seed=st.integers(0, 10_000),
    n=st.integers(120, 1500),
    gaps=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-3.0, 3.0)), max_size=4),
    jitter=st.sampled_from([0.0, 0.1, 0.4]),
    decimals=st.sampled_from([9, 4, 3, 2]),
    hold=st.sampled_from([1, 1, 1, 2, 7]),
    missing=st.sampled_from([0.0, 0.02, 0.3]),
)
@example(seed=3, n=120, gaps=[(0.5, 0.5), (0.46875, -1.0)], jitter=0.0, decimals=9, hold=2, missing=0.0)  # 4 between
@examples(60)
def test_any_log_that_is_read_keeps_its_samples_in_order(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    n: int,
    gaps: list[tuple[float, float]],
    jitter: float,
    decimals: int,
    hold: int,
    missing: float,
) -> None:
    """95 % of its samples, in the order of the file, or it is refused; of a slow sensor every n-th."""
    numbers = np.random.default_rng(seed)
    x_d = np.cumsum(np.cumsum(numbers.normal(0.0, 1e-6, n)))
    x = np.concatenate((np.full(5, x_d[0]), x_d))[:n][np.arange(n) // hold * hold]
    x[numbers.random(n) < missing] = np.nan
    t = 1e-3 * (np.arange(n) + jitter * numbers.uniform(-1.0, 1.0, n))
    for place, by in gaps:
        t[int(place * n) :] += by
    path = write(tmp_path_factory.mktemp("any") / "log.npz", {"t": np.round(t, decimals), "x_d": x_d, "x": x})
    try:
        log = read_log(path)
    except LogError as error:
        assert "log.npz" in str(error)  # noqa: PT017
        return
    if n <= len(log.t) <= n + 10 * len(gaps) and round(log.T_s / 1e-3, 1) == 1.0:
        recorded = np.isin(log.x_d, x_d)  # the others are rows that were lost
        np.testing.assert_array_equal(log.x_d[recorded], x_d)
        np.testing.assert_array_equal(log.x_meas[recorded], x)
        assert np.isnan(log.x_meas[~recorded]).all()
    else:
        period = round(log.T_s / 1e-3)
        assert hold > 1
        assert period % hold == 0
        assert -len(log.starts) <= len(log.t) - n / period <= len(log.starts) + 10 * len(gaps) / period
    assert all(np.diff(log.starts) > 0)


def test_noise_is_no_delay() -> None:
    """The best mixture spreads over all lags, 15 samples in the mean, where the best single one is 8."""
    t = 1e-2 * np.arange(3000)
    x_d = 0.05 * (1.0 - np.cos(1.8 * np.pi * t / 2.0)) + 0.01 * (1.0 - np.cos(4.2 * np.pi * t / 2.0))
    x = np.r_[np.zeros(8), x_d[:-8]] + np.random.default_rng(0).normal(0.0, 0.03, len(t))
    assert "late" not in {one.name for one in check(log_of(x_d, x, 1e-2))}
