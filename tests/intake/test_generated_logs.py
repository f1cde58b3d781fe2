"""Intake of generated logs: forty good ones that are not refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from generated_logs import ACCUSED_BEFORE, COMMANDS, DRIVES, generated_log

from hybridsep import ModalModel, Mode
from hybridsep.intake.check import check
from hybridsep.intake.finding import ERROR, NOTE

SEEDS = range(1000, 1033)
"""Of logs on which no threshold was chosen."""


@pytest.mark.parametrize("seed", SEEDS)
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
