"""The pythonfmu FMUs through fmpy: what is refused, how it is said, and that nothing else is harmed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fmu_driving import TS, delayed, drive

from hybridsep import FmuInstance, build_fmu, fmu_names, load_machine
from hybridsep.base.errors import FmuError

Fmu = Callable[[str], Path]


@pytest.fixture
def predictor(python_fmu: Fmu) -> Iterator[FmuInstance]:
    with FmuInstance(python_fmu("HybridPredictorPy")) as instance:
        yield instance


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"p": 120}, "p must be 1 … Np = 100, got 120; lower p or raise Np"),
        ({"q": 100}, "q must be 0 … Np − 1 = 99, got 100; lower q or raise Np"),
        ({"Np": 0}, "Np must be 1 … 100000, got 0"),
        ({"lambda": 0.0}, "lambda must be 1e-40 … 1e+12 m2, got 0.0"),
        ({"lambda": -1.0, "T_s": 0.0}, "lambda must be 1e-40 … 1e+12 m2, got -1.0; T_s must be 1e-05 … 1 s, got 0.0"),
        ({"t_init": -0.1}, "t_init must be 0 … 1000000 s, got -0.1"),
        ({"input_hold": 2}, "input_hold must be 0 … 1, got 2"),
        ({"dead_time": -1}, "dead_time must be 0 … 100000, got -1"),
        ({"mode[1].zeta": 0.0}, r"mode[1].zeta must be 1e-06 … 10000, got 0.0"),
        ({"T_s": 1e-300}, "T_s must be 1e-05 … 1 s, got 1e-300"),
        ({"mode[1].f_n": 1e308}, "mode[1].f_n must be 0.001 … 100000 Hz, got 1e+308"),
        ({"mode[1].f_n": math.nan}, r"mode[1].f_n must be finite, got nan"),
        ({"mode[1].alpha": math.inf}, r"mode[1].alpha must be finite, got inf"),
        ({"x_d_ahead": math.inf}, "the start value of x_d_ahead must be finite, got inf"),
    ],
)
def test_bad_parameters_are_named_and_others_live_on(python_fmu: Fmu, values: dict[str, float], message: str) -> None:
    with FmuInstance(python_fmu("HybridPredictorPy"), "good") as good:
        good.initialise()
        with FmuInstance(python_fmu("HybridPredictorPy"), "bad") as bad:
            with pytest.raises(FmuError) as error:
                bad.initialise(values)
            assert message in str(error.value)
            assert message in bad.log[-1][1]
            with pytest.raises(FmuError):  # a second failure ends nothing either
                bad.initialise(values)
        good.step(0.0, TS)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("FeedDrivePy", {"m": 0.0}, "m must be 1e-06 … 1000000 kg, got 0.0"),
        ("FeedDrivePy", {"k": 1e308}, "k must be 1e-06 … 1e+15 N/m, got 1e+308"),
        ("FeedDrivePy", {"k_nl": -1.0}, "k_nl must be 0 … 1e+15 N/m2, got -1.0"),
        ("FeedDrivePy", {"noise_std": math.nan}, "noise_std must be finite, got nan"),
        ("FeedDrivePy", {"seed": -1}, "seed must be"),
        ("FeedDrivePy_als25010_x", {"f": -1.0}, "f must be 0 … 1 m, got -1.0"),
        ("FeedDrivePy_als25010_x", {"kappa": -1.0}, "kappa must be 0 … 1000000 1/m, got -1.0"),
        ("FeedDrivePy_als25010_x", {"mode[2].zeta": -0.1}, "mode[2].zeta must be 1e-06 … 10000, got -0.1"),
    ],
)
def test_bad_plant_parameters_are_named(python_fmu: Fmu, name: str, values: dict[str, float], message: str) -> None:
    with FmuInstance(python_fmu(name)) as plant, pytest.raises(FmuError) as error:
        plant.initialise(values)
    assert message in str(error.value)


def test_a_refused_step_is_logged_and_changes_nothing(predictor: FmuInstance) -> None:
    r, x = delayed(n=400)
    predictor.initialise()
    drive(predictor, r, x, 0, 250)
    t = 250 * TS
    for name, value, h, at, message in (
        ("x_meas", math.nan, TS, t, "x_meas must be finite, got nan at sample 250"),
        ("x_d_ahead", -math.inf, TS, t, "x_d_ahead must be finite, got -inf at sample 250"),
        ("x_meas", 0.0, 0.0, t, "the communication step size must be > 0 and ≤ 100 s, got 0.0"),
        ("x_meas", 0.0, TS, t + 0.1, "the communication point must be 0.25 s, where the last step ended, got 0.35 s"),
    ):
        predictor.set("x_d_ahead", 0.0)
        predictor.set("x_meas", 0.0)
        predictor.set(name, value)
        with pytest.raises(FmuError) as error:
            predictor.step(at, h)
        assert message in str(error.value)
        status, said = predictor.log[-1]
        assert (status, message in said) == (3, True)
    after = drive(predictor, r, x, 250, 400)
    with FmuInstance(predictor.path) as untroubled:
        untroubled.initialise()
        np.testing.assert_array_equal(drive(untroubled, r, x, 0, 400)[250:], after)


def test_plants_refuse_bad_inputs(python_fmu: Fmu) -> None:
    with FmuInstance(python_fmu("FeedDrivePy")) as plant:
        plant.initialise()
        plant.set("x_d", math.nan)
        with pytest.raises(FmuError, match=r"x_d must be finite, got nan at t = 0 s"):
            plant.step(0.0, TS)
        plant.set("x_d", 1e-3)
        with pytest.raises(FmuError, match=r"the communication step size must be > 0 and ≤ 100 s, got -0.001"):
            plant.step(0.0, -TS)
        plant.step(0.0, TS)


def test_calls_that_are_not_allowed_now(predictor: FmuInstance) -> None:
    with pytest.raises(FmuError, match=r"doStep is not allowed before the initialization has ended"):
        predictor.step(0.0, TS)
    predictor.initialise()
    with pytest.raises(FmuError, match=r"p is a fixed parameter and cannot be set after initialization, got 3"):
        predictor.set("p", 3)
    with pytest.raises(FmuError, match=r"x_h is an output variable and cannot be set"):
        predictor.set("x_h", 0.0)
    with pytest.raises(FmuError, match=r"has no variable 'speed'"):
        predictor.set("speed", 0.0)
    predictor.step(0.0, TS)
    assert predictor.get("p") == 50


def test_foreign_states_are_refused(predictor: FmuInstance, python_fmu: Fmu) -> None:
    predictor.initialise()
    blob = predictor.save()
    with FmuInstance(python_fmu("HybridPredictorPy_als25010_x")) as other:
        with pytest.raises(FmuError, match=r"the state belongs to another FMU than HybridPredictorPy_als25010_x"):
            other.restore(blob)
        for damaged in (blob[:-4], blob[:100], b"", bytes(len(blob))):
            with pytest.raises(FmuError, match=r"saved state"):
                other.restore(damaged)


def test_what_is_no_fmu(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=r"no FMU at .*missing.fmu; build it first"):
        FmuInstance(tmp_path / "missing.fmu")
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(FmuError, match=r"text.fmu is not a readable FMU"):
        FmuInstance(tmp_path / "text.fmu")
    machine = load_machine("emps")
    with pytest.raises(FmuError, match=r"machine emps has no FMU 'FeedDrivePy_emps'; it has HybridPredictorPy_emps"):
        build_fmu(machine, "FeedDrivePy_emps", tmp_path, "python")
    with pytest.raises(FmuError, match=r"backend must be one of .*, got 'fortran'"):
        fmu_names(machine, "fortran")
