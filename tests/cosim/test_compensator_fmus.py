"""Compensator FMU against plant FMU: tracking errors, limits, agreement with the library, files and figures."""

from __future__ import annotations

import csv
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built_once import BuiltFmus

from hybridsep import fmu_names, load_machine
from hybridsep.base.errors import FmuError, SignalError
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, PredictorSettings
from hybridsep.cosim.adapters import check_controller
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import COMPENSATOR, Run
from hybridsep.evaluate.figures import contour_figure, tracking_figure
from hybridsep.fmi.flavours import FLAVOURS
from hybridsep.machines.machine import Machine
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import spiral, staircase

MACHINE = load_machine("spring_mass_damper")
PAPER = {"averaging": False, "Np": 100, "p": 50, "q": 3, "lambda": 1e-12, "t_init": 0.3}
COMPENSATE = PARAMETERS["compensate"]
TOLERANCE = 1e-9  # m, between library and FMU
PNG = b"\x89PNG\r\n\x1a\n"

Fmu = Callable[[str], Path]
Pair = tuple[Path, Path]


def name_of(model: str, machine: Machine, flavour: str) -> str:
    return next(name for name, built in fmu_names(machine, flavour).items() if built == model)


@pytest.fixture(scope="module", params=FLAVOURS)
def flavour(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def runs(fmus: BuiltFmus) -> Callable[[str, str], Run]:
    """Return a function that gives the run of a flavour and a choice with the paper's model and settings.

    The staircase, of the Python flavour, which is the library, its beginning.
    """

    @cache
    def run(flavour: str, choice: str) -> Run:
        controller, plant = (fmus(name_of(model, MACHINE, flavour)) for model in ("SepCompensator", "FeedDrive"))
        r = staircase() if flavour == "native" else staircase()[:1500]
        return cosimulate(controller, plant, r, controller_values={**PAPER, "compensate": COMPENSATE.to_fmi(choice)})

    return run


@cache
def loop_of(choice: str) -> Run:
    """Return the library's run with the same settings."""
    values = {**MACHINE.fmi_compensator_parameters(), **PAPER, "compensate": COMPENSATE.to_fmi(choice)}
    settings = CompensatorSettings.from_fmi(values)
    compensator = MACHINE.new_compensator(settings, predictor=PredictorSettings.from_fmi(values))
    return cosimulate(compensator, MACHINE.new_plant(), staircase(), encoder=Encoder(5e-6, 0))


@pytest.fixture(scope="module")
def python_pair(python_fmu: Fmu) -> Pair:
    return python_fmu("SepCompensatorPy"), python_fmu("FeedDrivePy")


@pytest.fixture(scope="module")
def short(python_pair: Pair) -> Run:
    return cosimulate(*python_pair, staircase()[:600])


def until_its_end_is_seen(run: Run) -> int | None:
    """Return for how many samples a run equals the run of the whole staircase; None for all."""
    n = len(run.x_d)
    return None if n == len(staircase()) else n - int(MACHINE.fmi_compensator_parameters()["preview"])


def assert_same(run: Run, loop: Run, n: int | None = None) -> None:
    """Compare two runs, or their first ``n`` samples."""
    for name in ("x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "x_h_std"):
        one, other = getattr(run, name)[:n], getattr(loop, name)[:n]
        np.testing.assert_allclose(one, other, rtol=0, atol=TOLERANCE, err_msg=name)
    np.testing.assert_array_equal(run.state[:n], loop.state[:n])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("choice", "least", "most"), [("off", 87.0, 90.0), ("physics", 0.0, 20.5), ("hybrid", 0.0, 6.6)]
)
def test_staircase_tracking_error(runs: Callable[[str, str], Run], choice: str, least: float, most: float) -> None:
    """µm of the true position, p = 50, q = 3, one noise seed."""
    assert least <= runs("native", choice).summary()["tracking_rms_um"] <= most


@pytest.mark.parametrize("choice", COMPENSATE.choices)
def test_the_drives_limits_are_kept(runs: Callable[[str, str], Run], choice: str) -> None:
    limits, change_max = MACHINE.command_limits()
    assert limits is not None
    assert change_max is not None
    run = runs("native", choice)
    for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1):
        assert np.abs(np.diff(run.x_dm, order)).max() <= limit * MACHINE.T_s**order * (1 + 1e-9)
    assert np.abs(run.change).max() <= change_max
    assert run.summary()["change_max_um"] > 100.0 or choice == "off"


@pytest.mark.slow
@pytest.mark.parametrize("choice", COMPENSATE.choices)
def test_fmus_equal_the_library(runs: Callable[[str, str], Run], flavour: str, choice: str) -> None:
    run = runs(flavour, choice)
    assert_same(run, loop_of(choice), until_its_end_is_seen(run))
    np.testing.assert_array_equal(run.x_d, staircase()[: len(run.x_d)])
    assert run.t[0] == pytest.approx(0.2)


@pytest.fixture(scope="module")
def by_library(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Path, Run]:
    """The library with the machine's settings over the first moves, cold, the state it ends with, and warm after it."""
    compensator, trained = MACHINE.new_compensator(), tmp_path_factory.mktemp("trained") / "trained.state"
    r = staircase()[:2000]
    cold = cosimulate(compensator, MACHINE.new_plant(), r, encoder=Encoder(5e-6, 1))
    compensator.predictor.save(trained)
    warm = cosimulate(compensator, MACHINE.new_plant(), r, encoder=Encoder(5e-6, 2), t_init=0.0)
    return cold, trained, warm


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["native", pytest.param("python", marks=pytest.mark.nightly)])
def test_recommended_settings_cold_and_warm(flavour: str, fmus: BuiltFmus, by_library: tuple[Run, Path, Run]) -> None:
    pair = fmus(name_of("SepCompensator", MACHINE, flavour)), fmus(name_of("FeedDrive", MACHINE, flavour))
    first, weights, second = by_library
    # The figures are of the native FMU: it takes a tenth of the library's time.
    r = staircase() if flavour == "native" else staircase()[:1200]
    cold = cosimulate(*pair, r, plant_values={"seed": 1})
    shorter = cold if flavour == "python" else first
    same = until_its_end_is_seen(shorter)
    assert_same(cold, first, same)
    trained = fmus(name_of("SepCompensator", MACHINE, flavour), weights=weights)
    warm = cosimulate(trained, pair[1], r, plant_values={"seed": 2})
    assert_same(warm, second, same)
    assert warm.summary()["share_hybrid"] == 1.0
    if flavour == "native":
        assert cold.summary()["tracking_rms_um"] < 4.2
        assert warm.summary()["tracking_rms_um"] < 0.6


@pytest.mark.slow
def test_a_held_sensor_is_the_librarys(python_pair: Pair) -> None:
    class Held:
        def __init__(self) -> None:
            self.value = 0.0

        def __call__(self, k: int, x_meas: float) -> float:
            if not 1050 <= k < 1250:
                self.value = x_meas
            return self.value

    r = staircase()[:1500]
    run = cosimulate(*python_pair, r, sensor=Held())
    loop = cosimulate(MACHINE.new_compensator(), MACHINE.new_plant(), r, encoder=Encoder(5e-6, 0), sensor=Held())
    assert_same(run, loop)
    assert np.ptp(run.x_meas[1050:1250]) == 0.0


@pytest.mark.slow
def test_summary_is_what_the_signals_say(short: Run) -> None:
    summary = short.summary()
    error = 1e6 * (short.x_d - short.x)
    assert summary["tracking_rms_um"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert summary["tracking_max_um"] == pytest.approx(np.max(np.abs(error)))
    measured = 1e6 * (short.x_d - short.x_meas)
    assert summary["tracking_measured_rms_um"] == pytest.approx(np.sqrt(np.mean(measured**2)))
    assert summary["tracking_measured_max_um"] == pytest.approx(np.max(np.abs(measured)))
    change = 1e6 * (short.x_dm - short.x_d)
    assert summary["change_rms_um"] == pytest.approx(np.sqrt(np.mean(change**2)))
    assert summary["change_max_um"] == pytest.approx(np.max(np.abs(change)))
    assert summary["peak_jerk_m_s3"] == pytest.approx(np.max(np.abs(np.diff(short.x_dm, 3))) * 1e9)
    assert summary["peak_acceleration_m_s2"] == pytest.approx(np.max(np.abs(np.diff(short.x_dm, 2))) * 1e6)
    # Nothing is learned before the first window, of 50 samples; the second follows its plan for 24 more.
    assert summary["share_physics"] == pytest.approx(74 / 600)
    assert summary["share_off"] + summary["share_physics"] + summary["share_hybrid"] == pytest.approx(1.0)
    assert summary["n_samples"] == 600


@pytest.mark.slow
def test_start_time_and_a_shifted_start(python_pair: Pair, short: Run) -> None:
    moved = cosimulate(*python_pair, staircase()[:600] + 0.1, start_time=50.0)
    np.testing.assert_allclose(moved.x_dm - 0.1, short.x_dm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(moved.t - 50.0, short.t, rtol=0, atol=1e-12)
    assert (moved.Np, moved.T_s) == (50, 1e-3)


def test_results_as_csv_and_npz(short: Run, tmp_path: Path) -> None:
    short.save(tmp_path / "run.csv")
    short.save(tmp_path / "run.npz")
    with (tmp_path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with np.load(tmp_path / "run.npz") as arrays:
        expected = ["t", "x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "x_h_std", "state"]
        assert list(arrays) == list(rows[0]) == expected
        for name in arrays:
            np.testing.assert_array_equal(arrays[name], [float(row[name]) for row in rows])
            np.testing.assert_array_equal(arrays[name], getattr(short, name))
    assert {row["state"] for row in rows} == {"1", "2"}
    with pytest.raises(ValueError, match=r"written as .csv or .npz, got 'run.txt'"):
        short.save(tmp_path / "run.txt")


def test_progress_is_reported_to_the_end(python_pair: Pair) -> None:
    calls: list[tuple[int, int]] = []
    cosimulate(*python_pair, staircase()[:100], progress=lambda k, n: calls.append((k, n)))
    assert calls[-1] == (300, 300)


def test_what_is_refused(python_pair: Pair, python_fmu: Fmu) -> None:
    compensator, plant = python_pair
    with pytest.raises(SignalError, match="r must be finite, got nan at sample 1"):
        cosimulate(compensator, plant, [0.0, float("nan")])
    with pytest.raises(SignalError, match="r must have 1 samples, got 0"):
        cosimulate(compensator, plant, [])
    with pytest.raises(FmuError, match=r"HybridPredictorPy.fmu is no compensator: it has no output x_dm"):
        check_controller(python_fmu("HybridPredictorPy"), COMPENSATOR)
    with pytest.raises(FmuError, match=r"SepCompensatorPy.fmu is no plant: it has no input x_d$"):
        cosimulate(compensator, compensator, [0.0, 0.0])
    with pytest.raises(FmuError, match="preview must be ≥ Np"):
        cosimulate(compensator, plant, [0.0, 0.0], controller_values={"preview": 60})


@pytest.mark.slow
def test_figures(short: Run, tmp_path: Path) -> None:
    several = {"off": short, "physics": short, "hybrid_cold": short, "hybrid_warm": short}
    tracking_figure(several, "several", tmp_path / "several.png")
    for kind in COMPENSATE.choices:
        tracking_figure({kind: short}, kind, tmp_path / f"{kind}.png")
    pairs = {kind: (run, run) for kind, run in several.items()}
    errors = {kind: np.abs(run.error) for kind, run in several.items()}
    contour_figure(pairs, errors, "contour", tmp_path / "contour.png")
    for path in tmp_path.iterdir():
        assert path.read_bytes().startswith(PNG)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["native", pytest.param("python", marks=pytest.mark.nightly)])
def test_the_direction_can_be_turned_off(flavour: str, fmus: BuiltFmus) -> None:
    """A fixed parameter of the FMU, without a rebuild; the library with the same settings commands the same."""
    machine, r = load_machine("als25010_y"), spiral()[1][:1500]
    pair = fmus(name_of("SepCompensator", machine, flavour)), fmus(name_of("FeedDrive", machine, flavour))
    commands = []
    for change in ({}, {"no_reversal": False}):
        values: dict[str, Any] = {"averaging": False, "q": 40, "lambda": 1e-8, "t_init": 0.1, **change}
        run = cosimulate(*pair, r, controller_values=values)
        fmi = {**machine.fmi_compensator_parameters(), **values}
        compensator = machine.new_compensator(
            CompensatorSettings.from_fmi(fmi), predictor=PredictorSettings.from_fmi(fmi)
        )
        loop = cosimulate(compensator, machine.new_plant(), r, encoder=Encoder(1e-6, 0))
        assert_same(run, loop)
        against = np.diff(run.x_dm) * np.sign(np.diff(run.x_d))
        assert (np.min(against) < -1e-6) == ("no_reversal" in values)
        commands.append(run.x_dm)
    assert np.max(np.abs(commands[0] - commands[1])) > 1e-6
