"""Co-simulation loop: library objects and FMUs, alone and together, hooks, arguments that do not apply."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from hybridsep import Encoder, FmuInstance, backtest, cosimulate, load_machine, paper_machine, simulate, staircase
from hybridsep.base.errors import ParameterError
from hybridsep.cosim.run import COMPENSATOR, PREDICTOR

MACHINE = load_machine("spring_mass_damper")
R = staircase()[:1200]

Fmu = Callable[[str], Path]


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


def test_what_the_controller_takes_for_late_arrives_late(python_fmu: Fmu) -> None:
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
    fmu = cosimulate(python_fmu("HybridPredictorPy"), MACHINE.new_plant(), R, controller_values=values)
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
@pytest.mark.parametrize("model", ["HybridPredictor", pytest.param("SepCompensator", marks=pytest.mark.nightly)])
def test_library_and_fmu_take_each_others_place(python_fmu: Fmu, model: str) -> None:
    def new_controller() -> Any:
        return MACHINE.new_predictor() if model == "HybridPredictor" else MACHINE.new_compensator()

    controller, plant = python_fmu(f"{model}Py"), python_fmu("FeedDrivePy")
    library = cosimulate(new_controller(), MACHINE.new_plant(), R, encoder=encoder())
    assert library.kind == (PREDICTOR if model == "HybridPredictor" else COMPENSATOR)
    for run in (
        cosimulate(controller, MACHINE.new_plant(), R, encoder=encoder()),
        cosimulate(new_controller(), plant, R),
        cosimulate(controller, plant, R),
    ):
        assert run.kind == library.kind
        for name in ("t", "x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "state"):
            np.testing.assert_array_equal(getattr(run, name), getattr(library, name), err_msg=name)


def test_hooks_count_from_the_end_of_the_fill(python_fmu: Fmu) -> None:
    """``disturb`` gets the plant, or the instance of its FMU; ``sensor`` says what arrives."""
    seen: dict[str, list[tuple[int, type]]] = {"library": [], "fmu": []}

    def offset(k: int, x_meas: float) -> float:
        return x_meas + (1e-3 if k == 7 else 0.0)

    plants: dict[str, Any] = {"library": MACHINE.new_plant(), "fmu": python_fmu("FeedDrivePy")}
    for name, plant in plants.items():

        def look(k: int, subject: object, calls: list[tuple[int, type]] = seen[name]) -> None:
            calls.append((k, type(subject)))

        run = cosimulate(MACHINE.new_predictor(), plant, R[:150], sensor=offset, disturb=look)
        assert [k for k, _ in seen[name]] == list(range(-100, 150))
        assert np.argmax(run.x_meas - run.x) == 7
    assert {kind for _, kind in seen["library"]} == {type(plants["library"])}
    assert {kind for _, kind in seen["fmu"]} == {FmuInstance}


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
    python_fmu: Fmu, of_fmus: bool, arguments: dict[str, Any], message: str
) -> None:
    pair: tuple[Any, Any] = (
        (python_fmu("HybridPredictorPy"), python_fmu("FeedDrivePy"))
        if of_fmus
        else (MACHINE.new_predictor(), MACHINE.new_plant())
    )
    with pytest.raises(ParameterError, match=message):
        cosimulate(*pair, R, **arguments)
