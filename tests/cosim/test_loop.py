"""Co-simulation: library and FMUs in each other's place, against predictions of the log; results, files, hooks."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from built_once import BuiltFmus

from hybridsep import load_machine, paper_machine
from hybridsep.base.errors import FmuError, ParameterError, SignalError
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, PredictorSettings
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.cosim.loop import check_controller, cosimulate
from hybridsep.cosim.run import COMPENSATOR, PREDICTOR, ControllerType, Run
from hybridsep.evaluate.backtest import backtest
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.trajectory import staircase

MACHINE = load_machine("spring_mass_damper")
R = staircase()[:1200]
PAPER = {"averaging": False, "Np": 100, "p": 50, "q": 3, "lambda": 1e-12, "t_init": 0.3}


def encoder() -> Encoder:
    """Return the encoder of the plant FMU."""
    return Encoder(5e-6, 0)


def test_a_predictor_of_the_library_is_an_open_loop() -> None:
    run = cosimulate(MACHINE.new_predictor(), MACHINE.new_plant(), R, encoder=encoder())
    assert run.kind == PREDICTOR
    np.testing.assert_array_equal(run.x_d, R)
    np.testing.assert_array_equal(run.x_dm, R)
    np.testing.assert_array_equal(run.x, simulate(MACHINE.new_plant(), R, MACHINE.T_s))
    result = backtest(MACHINE.new_predictor(), R, run.x_meas)
    for name in ("x_pb", "x_hold", "x_h"):
        np.testing.assert_allclose(getattr(run, name), getattr(result, name), rtol=0, atol=1e-15, err_msg=name)
    np.testing.assert_array_equal(run.active, result.active)
    assert (run.Np, run.T_s, run.t[0]) == (100, MACHINE.T_s, pytest.approx(0.1))


def test_a_warm_predictor_is_active_at_once() -> None:
    predictor = paper_machine("spring_mass_damper").new_predictor()
    assert not cosimulate(predictor, MACHINE.new_plant(), R).active[:300].any()
    assert cosimulate(predictor, MACHINE.new_plant(), R, t_init=0.0).active.all()


def test_what_the_controller_takes_for_late_arrives_late(fmus: BuiltFmus) -> None:
    late = 5
    settings = replace(MACHINE.predictor_settings, measurement_delay=late)
    run = cosimulate(MACHINE.new_predictor(settings), MACHINE.new_plant(), R)
    sound = cosimulate(MACHINE.new_predictor(), MACHINE.new_plant(), R)
    np.testing.assert_array_equal(run.x_meas, sound.x_meas)  # as it was measured
    arrived = np.concatenate((np.full(late, R[0]), run.x_meas))[: len(R)]
    result = backtest(MACHINE.new_predictor(settings), R, arrived)
    for name in ("x_pb", "x_hold", "x_h"):
        found, expected = getattr(run, name)[:-late], getattr(result, name)[late:]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15, err_msg=name)
    values = {"measurement_delay": late}
    fmu = cosimulate(fmus("HybridPredictorPy"), MACHINE.new_plant(), R, controller_values=values)
    np.testing.assert_array_equal(fmu.x_h, run.x_h)
    assert fmu.measurement_delay == late


@pytest.mark.parametrize("section", ["predictor", "compensator"])
def test_a_drive_that_steps_first_makes_the_same_run(section: Literal["predictor", "compensator"]) -> None:
    runs = []
    for delay in (0, -1):
        machine = MACHINE.changed(section, {"measurement_delay": delay})
        made = machine.new_predictor() if section == "predictor" else machine.new_compensator()
        runs.append(cosimulate(made, MACHINE.new_plant(), R))
    for name in ("x_d", "x_dm", "x", "x_pb", "x_h", "state"):
        np.testing.assert_array_equal(getattr(runs[1], name), getattr(runs[0], name), err_msg=name)
    assert runs[1].summary() == runs[0].summary()


@pytest.mark.slow
def test_library_and_fmu_take_each_others_place(fmus: BuiltFmus) -> None:
    controller, plant = fmus("HybridPredictorPy"), fmus("FeedDrivePy")
    library = cosimulate(MACHINE.new_predictor(), MACHINE.new_plant(), R, encoder=encoder())
    for run in (
        cosimulate(controller, MACHINE.new_plant(), R, encoder=encoder()),
        cosimulate(MACHINE.new_predictor(), plant, R),
        cosimulate(controller, plant, R),
    ):
        assert run.kind == library.kind == PREDICTOR
        for name in ("t", "x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "state"):
            np.testing.assert_array_equal(getattr(run, name), getattr(library, name), err_msg=name)


def test_hooks_count_from_the_end_of_the_fill(fmus: BuiltFmus) -> None:
    """``disturb`` gets the plant, or the instance of its FMU; ``sensor`` says what arrives."""
    seen: list[tuple[int, type]] = []
    own = MACHINE.new_plant()
    for plant, kind in ((own, type(own)), (fmus("FeedDrivePy"), FmuInstance)):
        seen.clear()
        run = cosimulate(
            MACHINE.new_predictor(),
            plant,
            R[:150],
            sensor=lambda k, x_meas: x_meas + (1e-3 if k == 7 else 0.0),
            disturb=lambda k, subject: seen.append((k, type(subject))),
        )
        assert seen == [(k, kind) for k in range(-100, 150)]
        assert np.argmax(run.x_meas - run.x) == 7


def test_a_plant_that_is_changed_in_mid_run() -> None:
    def stiffen(k: int, plant: Any) -> None:
        if k == 1000:
            plant.k *= 1.1

    usual, changed = (cosimulate(MACHINE.new_predictor(), MACHINE.new_plant(), R, disturb=d) for d in (None, stiffen))
    np.testing.assert_array_equal(usual.x[:1001], changed.x[:1001])
    assert np.max(np.abs(usual.x - changed.x)) > 1e-6


@pytest.mark.parametrize(
    ("of_fmus", "arguments", "message"),
    [
        (True, {"t_init": 0.0}, "t_init is for a controller of the library; an FMU's is among its controller_values"),
        (True, {"encoder": Encoder()}, "encoder is for a plant of the library; an FMU's noise and seed are among"),
        (False, {"controller_values": {"p": 3}}, "controller_values are for an FMU; make the controller with these"),
        (False, {"plant_values": {"seed": 3}}, "plant_values are for an FMU; make the plant with these parameters"),
    ],
)
def test_arguments_that_have_no_use_are_refused(
    fmus: BuiltFmus, of_fmus: bool, arguments: dict[str, Any], message: str
) -> None:
    pair: tuple[Any, Any] = (
        (fmus("HybridPredictorPy"), fmus("FeedDrivePy")) if of_fmus else (MACHINE.new_predictor(), MACHINE.new_plant())
    )
    with pytest.raises(ParameterError, match=message):
        cosimulate(*pair, R, **arguments)


# FMUs --------------------------------------------------------------------------------------------------------------

SIGNALS: dict[ControllerType, list[str]] = {
    PREDICTOR: ["t", "x_d", "x", "x_meas", "x_pb", "x_hold", "x_h", "x_h_std", "active"],
    COMPENSATOR: ["t", "x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "x_h_std", "state"],
}


@pytest.fixture(scope="module")
def runs(fmus: BuiltFmus) -> dict[ControllerType, Run]:
    """Short runs of a predictor and of a compensator."""
    plant = fmus("FeedDrivePy")
    return {
        PREDICTOR: cosimulate(fmus("HybridPredictorPy"), plant, R[:900]),
        COMPENSATOR: cosimulate(fmus("SepCompensator"), fmus("FeedDrive"), R[:600]),
    }


@pytest.mark.slow
@pytest.mark.parametrize("choice", PARAMETERS["compensate"].choices)
def test_native_fmus_equal_the_library_and_keep_the_drives_limits(fmus: BuiltFmus, choice: str) -> None:
    """1 nm, with the paper's model."""
    values = {**PAPER, "compensate": PARAMETERS["compensate"].to_fmi(choice)}
    run = cosimulate(fmus("SepCompensator"), fmus("FeedDrive"), R, controller_values=values)
    given = {**MACHINE.fmi_compensator_parameters(), **values}
    library = MACHINE.new_compensator(CompensatorSettings.from_fmi(given), predictor=PredictorSettings.from_fmi(given))
    loop = cosimulate(library, MACHINE.new_plant(), R, encoder=encoder())
    for name in SIGNALS[COMPENSATOR]:
        one, other = getattr(run, name), getattr(loop, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=0 if name == "state" else 1e-9, err_msg=name)
    assert run.t[0] == pytest.approx(0.2)
    limits, change_max = MACHINE.command_limits()
    assert limits is not None
    for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1):
        assert np.abs(np.diff(run.x_dm, order)).max() <= limit * MACHINE.T_s**order * (1 + 1e-9)
    assert change_max is not None
    assert np.abs(run.change).max() <= change_max
    assert run.summary()["change_max_um"] > 100.0 or choice == "off"


@pytest.mark.slow
def test_summary_is_what_the_signals_say(runs: dict[ControllerType, Run]) -> None:
    short = runs[COMPENSATOR]
    summary, change = short.summary(), 1e6 * (short.x_dm - short.x_d)
    for name, error in (("tracking", short.x_d - short.x), ("tracking_measured", short.x_d - short.x_meas)):
        assert summary[f"{name}_rms_um"] == pytest.approx(1e6 * np.sqrt(np.mean(error**2)))
        assert summary[f"{name}_max_um"] == pytest.approx(1e6 * np.max(np.abs(error)))
    assert summary["change_rms_um"] == pytest.approx(np.sqrt(np.mean(change**2)))
    assert summary["change_max_um"] == pytest.approx(np.max(np.abs(change)))
    assert summary["peak_jerk_m_s3"] == pytest.approx(np.max(np.abs(np.diff(short.x_dm, 3))) * 1e9)
    assert summary["peak_acceleration_m_s2"] == pytest.approx(np.max(np.abs(np.diff(short.x_dm, 2))) * 1e6)
    # Nothing is learned before the first window, of 50 samples; the second follows its plan for 24 more.
    assert summary["share_physics"] == pytest.approx(74 / 600)
    assert summary["share_off"] + summary["share_physics"] + summary["share_hybrid"] == pytest.approx(1.0)
    assert summary["n_samples"] == 600
    run = runs[PREDICTOR]
    result = backtest(MACHINE.new_predictor(), R[:900], run.x_meas)
    assert run.summary()["rms_h_um"] == pytest.approx(result.summary()["rms_h_um"], rel=1e-9)
    np.testing.assert_allclose(run.batch_rms()["x_h"], result.batch_rms_h, rtol=1e-9)


@pytest.mark.parametrize("kind", SIGNALS)
def test_results_as_csv_and_npz(runs: dict[ControllerType, Run], tmp_path: Path, kind: ControllerType) -> None:
    run = runs[kind]
    run.save(tmp_path / "run.csv")
    run.save(tmp_path / "run.npz")
    with (tmp_path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with np.load(tmp_path / "run.npz") as arrays:
        assert list(arrays) == list(rows[0]) == SIGNALS[kind]
        for name in arrays:
            np.testing.assert_array_equal(arrays[name], [float(row[name]) for row in rows])
            np.testing.assert_array_equal(arrays[name], getattr(run, name))
    with pytest.raises(ValueError, match=r"written as .csv or .npz, got 'run.txt'"):
        run.save(tmp_path / "run.txt")


def test_progress_is_reported_to_the_end(fmus: BuiltFmus) -> None:
    calls: list[tuple[int, int]] = []
    pair = fmus("HybridPredictorPy"), fmus("FeedDrivePy")
    cosimulate(*pair, staircase()[:300], progress=lambda k, n: calls.append((k, n)))
    assert calls[-1] == (400, 400)
    assert 50 < len(calls) < 150


def test_what_is_refused(fmus: BuiltFmus) -> None:
    names = ("HybridPredictorPy", "SepCompensator", "FeedDrivePy", "FeedDrivePy_als25010_x")
    predictor, compensator, plant, other = map(fmus, names)
    cases: list[tuple[tuple[Path, Path], list[float], dict[str, Any], str]] = [
        ((predictor, plant), [0.0, float("nan")], {}, "r must be finite, got nan at sample 1"),
        ((predictor, plant), [], {}, "r must have at least one sample, got none"),
        ((compensator, plant), [0.0], {"controller_values": {"preview": 60}}, "preview must be ≥ Np"),
        ((predictor, plant), [0.0], {"plant_values": {"stiffness": 1.0}}, "has no variable 'stiffness'"),
        ((plant, predictor), [0.0], {}, r"FeedDrivePy.fmu is no predictor: it has no input x_d_ahead"),
        ((predictor, predictor), [0.0], {}, r"HybridPredictorPy.fmu is no plant: it has no input x_d$"),
        (
            (predictor, other),
            [0.0],
            {"plant_values": {"T_s": 0.002}},
            r"FeedDrivePy_als25010_x.fmu has T_s = 0.002 s, but HybridPredictorPy.fmu has 0.001 s",
        ),
    ]
    for seed in (99_999_999_999, 1.5, "one"):
        said = rf"seed must be a whole number .* got {seed!r}"
        cases.append(((predictor, plant), [0.0], {"plant_values": {"seed": seed}}, said))
    for pair, r, values, message in cases:
        with pytest.raises((FmuError, SignalError), match=message):
            cosimulate(*pair, r, **values)
    with pytest.raises(FmuError, match=r"HybridPredictorPy.fmu is no compensator: it has no output x_dm"):
        check_controller(predictor, COMPENSATOR)
