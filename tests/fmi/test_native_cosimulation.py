"""Native and pythonfmu FMUs in co-simulation, in every pairing, against the library in the same wiring."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest
from built_once import NATIVE, PYTHON, BuiltFmus, each_kind
from library_models import library_look_ahead
from library_stream import start_values

from hybridsep.base.errors import FmuError, SignalError
from hybridsep.base.signals import Array
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.flavours import FLAVOURS
from hybridsep.fmi.spec import fmu_names
from hybridsep.machines.machine import PAPER_SETTINGS, Machine, load_machine
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import staircase

TOLERANCE = 1e-11  # m


def reference(machine: Machine, r: Array) -> dict[str, Array]:
    """Return what the library alone computes in the same wiring, with the paper's settings, without the first fill."""
    return _reference(machine.name, tuple(r.tolist()))


@cache
def _reference(name: str, r: tuple[float, ...]) -> dict[str, Array]:
    """Return the same; every pairing is compared with one run."""
    machine = load_machine(name)
    assert machine.plant is not None
    plant, encoder = machine.new_plant(), Encoder(machine.plant.noise_std, machine.plant.seed)
    model = next(iter(fmu_names(machine)))
    look_ahead = library_look_ahead({**start_values(model), "x_d_ahead": r[0]})
    plant.reset(r[0])
    x_meas = encoder.measure(plant.x)
    rows = []
    for k in range(len(r) + look_ahead.Np):
        rows.append((look_ahead.x_d, look_ahead.x_pb, look_ahead.x_h, plant.x, x_meas))
        x_d = look_ahead.x_d
        look_ahead.sample(r[min(k, len(r) - 1)], x_meas)
        plant.step(x_d, machine.T_s)
        x_meas = encoder.measure(plant.x)
    return dict(zip(("x_d", "x_pb", "x_h", "x", "x_meas"), np.array(rows)[look_ahead.Np :].T, strict=True))


def assert_equal(run: Run, expected: dict[str, Array]) -> None:
    for name, samples in expected.items():
        np.testing.assert_allclose(getattr(run, name), samples, rtol=0, atol=TOLERANCE, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("plant", FLAVOURS)
@pytest.mark.parametrize("predictor", FLAVOURS)
def test_every_pairing_agrees_with_the_library_on_the_staircase(fmus: BuiltFmus, predictor: str, plant: str) -> None:
    machine = load_machine("spring_mass_damper")
    suffix = {"native": "", "python": "Py"}
    pair = fmus(f"HybridPredictor{suffix[predictor]}"), fmus(f"FeedDrive{suffix[plant]}")
    # A Python FMU is the library: its beginning is enough.
    command = staircase()[: None if predictor == plant == "native" else 1500]
    run = cosimulate(*pair, command, controller_values=PAPER_SETTINGS[machine.name])
    assert_equal(run, reference(machine, command))
    assert run.summary()["reduction_percent"] > 50 or len(command) == 1500


@pytest.mark.slow
def test_given_samples_are_trajectory_3(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    samples = 0.2 + np.cumsum(np.random.default_rng(1).normal(0, 1e-4, 40))
    path = build_fmu(machine, "ReferenceTrajectory", tmp_path, targets=("host",), samples=samples)
    assert_played(path, 3, samples)
    with pytest.raises(SignalError, match="samples"):
        build_fmu(machine, "ReferenceTrajectory", tmp_path, targets=("host",), samples=[0.0, np.nan])


def assert_played(path: Path, n: int, command: Array) -> None:
    with FmuInstance(path) as source:
        source.initialise({"trajectory": n}, start_time=3.0)
        played = [source.get("r")]
        for k in range(len(command) + 5):
            source.step(3.0 + k * 1e-3, 1e-3)
            played.append(source.get("r"))
    np.testing.assert_array_equal(played[: len(command)], command)
    assert set(played[len(command) :]) == {command[-1]}


@pytest.mark.slow
def test_a_trajectory_that_is_not_there_is_named(fmus: BuiltFmus) -> None:
    with FmuInstance(fmus("ReferenceTrajectory")) as source, pytest.raises(FmuError, match="trajectory"):
        source.initialise({"trajectory": 3})


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind([*NATIVE, *PYTHON]))
def test_a_run_with_the_importers_defaults_reaches_the_end(fmus: BuiltFmus, name: str) -> None:
    stop = float(fmpy.read_model_description(str(fmus(name))).defaultExperiment.stopTime)
    end = {"emps": 10.0}.get(name.rpartition("_")[2], 6.0 + (0.2 if "Sep" in name else 0.1))
    assert stop == pytest.approx(end, abs=0.011)
    # The same clock in Python, and with other modes: suite/test_timing.py
    for interval in (None, stop / 500) if name in NATIVE and "als" not in name else (None,):
        result = fmpy.simulate_fmu(str(fmus(name)), output_interval=interval)
        assert result["time"][-1] == pytest.approx(stop, abs=1e-9)
        assert len(result) >= 500
        assert all(np.isfinite(result[column].astype(float)).all() for column in result.dtype.names)


@pytest.mark.slow
def test_the_default_step_of_an_importer_does_no_harm(fmus: BuiltFmus) -> None:
    """fmpy's step for a run of 4 s is 4 ms; the paper's model goes to 20 mm then, on a sine of 10 mm."""
    t = np.arange(0.0, 4.1, 1e-3)
    signals = np.zeros(len(t), dtype=[("time", float), ("x_d_ahead", float), ("x_meas", float)])
    signals["time"], signals["x_d_ahead"] = t, 0.01 * np.sin(2 * np.pi * t)
    signals["x_meas"] = np.where(t > 0.1, 0.0101 * np.sin(2 * np.pi * (t - 0.1) - 0.02), 0.0)
    path = str(fmus("HybridPredictor"))
    default, paper = (
        np.abs(fmpy.simulate_fmu(path, stop_time=4.0, input=signals, start_values=values, output=["x_h"])["x_h"]).max()
        for values in ({}, PAPER_SETTINGS["spring_mass_damper"])
    )
    assert 9.9e-3 < default < 10.2e-3
    assert paper > 15e-3
