"""Intake of generated logs: forty good ones that are not refused, and spoiled ones whose fault is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from generated_logs import ACCUSED_BEFORE, COMMANDS, DRIVES, generated_log
from places import SO101
from spoiled_logs import FAULTS
from standing_axes import clipped_axis, standing_axis

from hybridsep import ModalModel, Mode
from hybridsep.intake.check import check
from hybridsep.intake.clipped import check_clipped
from hybridsep.intake.finding import ERROR, NOTE
from hybridsep.logs.log import read_log

SEEDS = (*range(1000, 1033), 2105)
"""Of logs on which no threshold was chosen."""

MOVES = {fault: 1000 + 8 * i for i, fault in enumerate(FAULTS)}
"""Seeds of moves with rests, an axis for each fault."""
MOVES["offset of 0.25 m"] = 1016  # instead of an axis of 40 rad, on which it is little
MOVES["8 samples early"] = 1032  # instead of an axis that lags by more, and now by less

FOUND_BY_NOBODY = ("clipped", "logs pasted together", "rows lost, times anew")
SPOILED = [
    *MOVES.items(),
    *(
        pytest.param(fault, seed, marks=[] if seed == 1011 else [pytest.mark.nightly])
        for fault in FOUND_BY_NOBODY
        for seed in (1002, 1003, 1011, 1023)
    ),
]


def one_of_three(seeds: Sequence[int]) -> list[Any]:
    """Return seeds as parameters, two of three of which run at night."""
    return [pytest.param(seed, marks=[pytest.mark.nightly] if i % 3 else []) for i, seed in enumerate(seeds)]


@pytest.mark.parametrize("seed", one_of_three(SEEDS))
def test_a_good_log_is_not_refused(seed: int) -> None:
    generated = generated_log(seed)
    intake = check(generated.log)
    accused = [finding for finding in intake.findings if finding.name != "start in motion" and finding.severity != NOTE]
    assert accused == [], generated
    assert intake.usable


def test_the_good_logs_have_every_command_and_every_drive() -> None:
    generated = [generated_log(seed) for seed in range(1000, 1048)]
    assert {one.command for one in generated} == set(COMMANDS)
    assert {one.drive for one in generated} == set(DRIVES)


@pytest.mark.parametrize("name", ACCUSED_BEFORE)
def test_a_good_log_that_was_refused(name: str) -> None:
    accused_as, make = ACCUSED_BEFORE[name]
    found = check(make()).findings
    assert [finding.name for finding in found if finding.severity == ERROR] == []
    assert all(finding.severity == NOTE and finding.fix is None for finding in found if finding.name == accused_as)


def test_a_lag_written_as_one_fast_mode_needs_no_fast_sampling() -> None:
    """A lag of 20 ms as a mode of 4.8 kHz with a damping ratio of 300, and one with an own zero."""
    log = generated_log(1000).log
    omega = 2 * 3.14159 * 4800.0
    for mode in (Mode(4800.0, omega * 0.02 / 2, omega**2), Mode(4800.0, 1.0, omega**2, omega)):
        machine: Any = SimpleNamespace(
            model=ModalModel([mode]), physics=SimpleNamespace(input_hold="zoh"), name="lag", T_s=log.T_s
        )
        assert "sampling rate" not in [finding.name for finding in check(log, machine).findings]
    ringing: Any = SimpleNamespace(
        model=ModalModel([Mode(0.4 / log.T_s, 0.1, (0.8 * 3.14159 / log.T_s) ** 2)]),
        physics=SimpleNamespace(input_hold="zoh"),
        name="ringing",
        T_s=log.T_s,
    )
    (finding,) = [one for one in check(log, ringing).findings if one.name == "sampling rate"]
    assert "2.5 samples a period" in finding.words


@pytest.mark.parametrize(("fault", "seed"), SPOILED)
def test_a_fault_is_named(fault: str, seed: int) -> None:
    name, spoil = FAULTS[fault]
    generated = generated_log(seed)
    good = replace(generated.log, unit="m", unit_stated=False) if name == "unit" else generated.log
    found = [finding.name for finding in check(spoil(good)).findings if finding.severity != NOTE or name == "delay"]
    accompanied = {"start in motion", "gaps"} if name != "start in motion" else set()
    assert set(found) - accompanied == {name} or found == [name], generated


def test_rows_that_were_lost_are_inserted_where_they_were() -> None:
    good = generated_log(1002).log
    keep = np.ones(len(good.t), dtype=np.bool_)
    keep[[700, 701, 1500, 1800, 2200]] = False
    n = int(keep.sum())
    spoiled = replace(good, t=good.t[:n], x_d=good.x_d[keep], x_meas=good.x_meas[keep])
    (finding,) = [one for one in check(spoiled).findings if one.name == "lost rows"]
    assert finding.words.startswith("5 rows are missing, and the times were numbered anew: in 4 samples (")
    assert "before sample 701" in finding.words
    assert finding.fix is not None
    fixed = finding.fix.change(spoiled)
    np.testing.assert_allclose(fixed.t, good.t)
    np.testing.assert_array_equal(np.isnan(fixed.x_meas), ~keep)
    np.testing.assert_allclose(fixed.x_d, good.x_d, atol=1e-3 * np.ptp(good.x_d))
    (finding,) = [one for one in check(spoiled, bridged=0).findings if one.name == "lost rows"]
    assert finding.fix is not None
    np.testing.assert_allclose(finding.fix.change(spoiled).x_meas, good.x_meas, atol=0.01 * np.ptp(good.x_d))


def test_what_is_clipped_is_missing_or_cut_out() -> None:
    good = generated_log(1003).log
    limit = float(np.quantile(good.x_meas, 0.9))
    spoiled = replace(good, x_meas=np.minimum(good.x_meas, limit))
    (finding,) = [one for one in check(spoiled).findings if one.name == "clipped"]
    assert finding.severity == ERROR
    factor, unit = good.shown.position
    assert unit == "mm"
    assert f"clipped at {factor * limit:.6g} {unit} in " in finding.words
    assert finding.picture is not None
    assert finding.picture.y_label == "position [mm]"
    np.testing.assert_array_equal(finding.picture.lines["commanded"][1], factor * good.x_d)
    fixed = check(spoiled).fixed()
    assert np.nanmax(fixed.x_meas) < limit
    known = np.isfinite(fixed.x_meas)
    np.testing.assert_array_equal(fixed.x_meas[known], good.x_meas[known])
    assert "clipped" not in [one.name for one in check(fixed).findings]
    apart = check(spoiled, bridged=0).fixed()
    assert np.isfinite(apart.x_meas).all()
    assert len(apart.segments()) > 1


@pytest.mark.parametrize("seed", one_of_three(range(1000, 1018)))
def test_an_axis_that_stands_by_friction_is_not_refused(seed: int) -> None:
    intake = check(standing_axis(seed))
    assert [finding.name for finding in intake.errors] == []
    assert intake.usable


@pytest.mark.skipif(not SO101.is_dir(), reason="needs ../shared/data/so101 beside the repository")
@pytest.mark.parametrize("path", sorted(SO101.glob("*.csv")), ids=lambda path: path.stem)
def test_a_recorded_arm_is_not_refused(path: Path) -> None:
    intake = check(read_log(path, uniform=False))
    assert [finding.name for finding in intake.errors] == []
    assert intake.usable


@pytest.mark.parametrize("seed", one_of_three(range(1000, 1018)))
def test_an_axis_that_is_clipped_is_refused(seed: int) -> None:
    (finding,) = check_clipped(clipped_axis(seed))
    assert finding.severity == ERROR, finding.words
    assert finding.words.startswith("the measured position is clipped at ")


def test_an_axis_that_stands_at_one_place_is_noted() -> None:
    (finding,) = check_clipped(standing_axis(158))
    assert (finding.severity, finding.fix) == (NOTE, None)
    assert "stretches while its command goes further; the first is sample " in finding.words
    assert "an axis that stands by friction or load does so" in finding.words


def test_pasted_logs_are_kept_apart() -> None:
    good, other = generated_log(1000).log, generated_log(1000).log
    n, far = 1500, 2.0 * float(np.ptp(generated_log(1000).log.x_d))
    x_d, x = (np.concatenate((a[:n], far + b[n:])) for a, b in ((good.x_d, other.x_d), (good.x_meas, other.x_meas)))
    intake = check(replace(good, x_d=x_d, x_meas=x))
    (finding,) = [one for one in intake.findings if one.severity == ERROR]
    assert finding.name == "jumps"
    assert "logs were pasted together" in finding.words
    factor, unit = good.shown.position
    assert unit == "mrad"
    assert f"by up to {factor * np.abs(np.diff(x_d)).max():.4g} {unit}, where it otherwise moves by " in finding.words
    assert intake.fixed().starts == (0, n)
    command_only = check(replace(good, x_d=x_d))
    (finding,) = [one for one in command_only.findings if one.name == "jumps"]
    assert (finding.severity, finding.fix) == ("warning", None)


@pytest.mark.parametrize("seed", [1002, 1007])
def test_steps_that_are_the_command_are_no_jumps(seed: int) -> None:
    """Steps of a whole motion, as a step response is recorded, and a command that was held for eight samples."""
    good = generated_log(seed).log
    held = replace(good, x_d=good.x_d[np.arange(len(good.t)) // 8 * 8])
    assert "jumps" not in [one.name for one in check(held).findings]
    steps = np.where(np.arange(len(good.t)) // 500 % 2 == 1, 1.0, 0.0) * float(np.ptp(good.x_d))
    assert "jumps" not in [one.name for one in check(replace(good, x_d=steps)).findings]
