"""Errors of the pythonfmu FMUs through fmpy: refusals, their messages, and no other effect."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from driving import T_S

from hybridsep import FmuInstance, build_fmu, fmu_names, load_machine
from hybridsep.base.errors import FmuError

Fmu = Callable[[str], Path]


@pytest.fixture
def predictor(python_fmu: Fmu) -> Iterator[FmuInstance]:
    with FmuInstance(python_fmu("HybridPredictorPy")) as instance:
        yield instance


def test_a_refused_step_is_logged_as_an_error(predictor: FmuInstance) -> None:
    predictor.initialise()
    with pytest.raises(FmuError):
        predictor.step(0.0, -T_S)
    status, said = predictor.log[-1]
    assert status == 3
    assert "the communication step size must be" in said


def test_calls_that_are_not_allowed_now(predictor: FmuInstance) -> None:
    with pytest.raises(FmuError, match=r"doStep is not allowed before the initialization has ended"):
        predictor.step(0.0, T_S)
    predictor.initialise()
    with pytest.raises(FmuError, match=r"p is a fixed parameter and cannot be set after initialization, got 3"):
        predictor.set("p", 3)
    with pytest.raises(FmuError, match=r"x_h is an output variable and cannot be set"):
        predictor.set("x_h", 0.0)
    with pytest.raises(FmuError, match=r"has no variable 'speed'"):
        predictor.set("speed", 0.0)
    predictor.step(0.0, T_S)
    assert predictor.get("p") == 50


def test_what_is_no_fmu(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=r"no FMU at .*missing.fmu; build it first"):
        FmuInstance(tmp_path / "missing.fmu")
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(FmuError, match=r"text.fmu is not a readable FMU"):
        FmuInstance(tmp_path / "text.fmu")
    machine = load_machine("emps")
    with pytest.raises(FmuError, match=r"machine emps has no FMU 'FeedDrivePy_emps'; it has HybridPredictorPy_emps"):
        build_fmu(machine, "FeedDrivePy_emps", tmp_path, "python")
    with pytest.raises(FmuError, match=r"flavour must be one of .*, got 'fortran'"):
        fmu_names(machine, "fortran")
