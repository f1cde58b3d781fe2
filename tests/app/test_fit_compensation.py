"""``hybridsep fit`` with the drive's limits: the compensator FMU, and the tracking error to be expected."""

import gzip
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from command_line import Run, write_rows
from identification_cases import T_S
from machine_files import changed_machine
from places import LOOPS

from hybridsep import PAPER_LIMITS, ModalModel, Mode, load_machine, rest_to_rest
from hybridsep.base.errors import ParameterError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import CompensatorSettings
from hybridsep.base.signals import Array
from hybridsep.cosim.fir_inverse import FirInverse, PlayedCommand
from hybridsep.cosim.fmu import read_description
from hybridsep.cosim.loop import cosimulate
from hybridsep.fitting.compensation import binding_words, expected_tracking
from hybridsep.fitting.expected import Expected, Trial
from hybridsep.fitting.limits import drive_limits
from hybridsep.fitting.replay import Recording
from hybridsep.fitting.stretch import FACTORS, Stretch
from hybridsep.fmi.archive import build_fmu
from hybridsep.identify.model import machine_of
from hybridsep.logs.units import DisplayUnits
from hybridsep.machines.machine import Machine
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.stage_drive import StageDrive
from hybridsep.predict.averaging.model import AveragedModel
from hybridsep.predict.predictor import HybridPredictor

LIMITS = ("--v_max", 0.3, "--a_max", 30, "--j_max", 2e4)


def stage() -> StageDrive:
    """Return an axis with friction and cable stiffness."""
    return StageDrive(ModalModel([Mode(35.0, 0.4, (70 * np.pi) ** 2)]), f=8e-6, kappa=0.05, T_s=T_S)


def axis(drive_limits: dict[str, float]) -> Machine:
    return machine_of(
        *(stage().model, "zoh", T_S, "axis", "Axis"),
        unit="m",
        sources=["drawn"],
        predictor={"Np": 50},
        drive_limits=drive_limits,
    )


def command() -> Array:
    targets = np.concatenate(([0.0], np.random.default_rng(0).uniform(-0.01, 0.01, 8)))
    starts = [0.05 + 0.4 * i for i in range(8)]
    return rest_to_rest(targets, PAPER_LIMITS, T_S, start_times=starts, duration=3.3)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_the_compensator_is_built_and_its_effect_estimated(hybridsep: Run, tmp_path: Path) -> None:
    x_d = command()
    x = simulate(stage(), x_d, T_S) + 5e-7 * np.random.default_rng(1).standard_normal(len(x_d))
    log, out = write_rows(tmp_path / "axis.csv", x_d, x), tmp_path / "fit"
    said = hybridsep.done("fit", log, "--out", out, "--Np", 50, *LIMITS)
    words = " ".join(said.split())
    assert "over 1.64 s of the log: " in words  # whole windows of 20 samples
    assert re.search(r"by the hybrid, with which the FMU starts, and about [\d.]+ µm \(largest [\d.]+ µm\)", words)
    assert re.search(r"change_max is [\d.]+ µm\. (No limit binds|Limits bind) the compensated command", words)
    assert re.search(r"above following_error_max = [\d.]+ µm for three samples in a row", words)
    assert "An estimate: the compensator plans in closed loop on the identified model" in words
    assert re.search(r"where the model is right: left of [\d.]+ µm RMS on the log's most demanding [\d.]+ s", words)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Compensation" in page
    assert "<td>200, chosen</td>" in page
    machine = load_machine(out / "machine.toml")
    assert machine.drive_limits is not None
    limits = machine.drive_limits
    assert (limits.velocity, limits.acceleration, limits.jerk) == (0.3, 30, 2e4)
    # As large as without the options, where a millimetre applied silently
    assert machine.drive_limits.change_max == pytest.approx(2 * np.abs(x_d - x).max(), rel=1e-3)
    assert machine.compensator_settings.following_error_max == pytest.approx(1.3 * np.abs(x_d - x).max(), rel=1e-3)
    assert machine.compensator_settings.compensate == "hybrid"
    fmus = sorted(path.stem for path in out.glob("SepCompensator*.fmu"))
    assert fmus == ["SepCompensator_axis"]
    for name in fmus:
        starts = {one.name: one.start for one in read_description(out / f"{name}.fmu").modelVariables}
        assert (float(starts["v_max"]), int(starts["compensate"])) == (0.3, 2)
    tracking = json.loads((out / "fit.json").read_text())["tracking"]
    Np = machine.compensator_predictor.Np
    judged = slice(-(-(len(x) // 2) // Np) * Np, None)
    assert tracking["none"]["rms"] == pytest.approx(rms((x_d - x)[judged]), rel=1e-9)
    assert tracking["none"]["largest"] == pytest.approx(np.abs(x_d - x)[judged].max(), rel=1e-9)
    cold = build_fmu(machine, "SepCompensator_axis", tmp_path)
    for value, model in enumerate(("physics", "hybrid"), start=1):
        values = {"compensate": value}
        run = cosimulate(cold, stage(), x_d, controller_values=values, encoder=Encoder(5e-7, seed=2))
        # The same axis, whose friction does change with the command.
        assert tracking[model]["rms"] == pytest.approx(rms((run.x_d - run.x_meas)[judged]), rel=0.3)
        assert tracking[model]["rms"] < 0.6 * tracking["none"]["rms"]
    warm = cosimulate(
        out / "SepCompensator_axis.fmu",
        stage(),
        x_d,
        controller_values={"compensate": 2},
        encoder=Encoder(5e-7, seed=2),
    )
    assert warm.tracking_rms < run.tracking_rms
    learned = cast(AveragedModel, HybridPredictor.load(out / "trained.state").residual).learned
    assert learned.velocity_scale == pytest.approx(0.05 * np.abs(np.diff(x_d)).max() / T_S)
    half = len(x) // 2
    rival = FirInverse.fitted([(x_d[:half], x[:half])], 50)
    assert rival is not None
    run = cosimulate(PlayedCommand(rival.command(x_d), T_S), stage(), x_d, encoder=Encoder(5e-7, seed=2))
    assert tracking["inverse"]["rms"] == pytest.approx(rms((run.x_d - run.x_meas)[judged]), rel=0.3)
    wins = tracking["inverse"]["rms"] < tracking["hybrid"]["rms"]
    assert ("That is better than the hybrid in RMS" in words) == wins


@pytest.mark.slow
def test_steps_of_a_command_are_no_rounding() -> None:
    x_d = np.repeat([0.0, 1e-3, 2e-3, 1e-3], 75)
    machine = axis({"velocity": 0.3, "acceleration": 30.0, "jerk": 2e4})
    assert expected_tracking(machine, [Recording(x_d, simulate(stage(), x_d, T_S), 150)], lambda _: 0).rounding == 0.0


@pytest.mark.slow
def test_what_a_limit_costs_is_said_and_larger_ones_are_advised() -> None:
    x_d = command()[:1000]
    x = simulate(stage(), x_d, T_S)
    change_max = 0.3 * float(np.abs(x_d - x).max())
    machine = axis({"velocity": 0.3, "acceleration": 30.0, "jerk": 2e4, "change_max": change_max})
    found = expected_tracking(machine, [Recording(x_d, x, 500)], lambda _: None)
    found = replace(
        found, largest=1.5 * change_max, motion={"v_max": (0.5, 0.3), "a_max": (30.0, 30.0), "j_max": (2.5e4, 2e4)}
    )
    assert found.limits["hybrid"]["change_max"] > 0.1
    assert found.costs is not None
    assert list(found.costs.effects) == ["a_max", "j_max", "change_max"]
    sizes = {name: [errors[factor].rms for factor in FACTORS] for name, errors in found.costs.effects.items()}
    half, one, two = sizes["change_max"]
    assert half > 1.2 * one > 1.5 * two
    assert sizes["j_max"] == pytest.approx([one] * 3, rel=0.05)  # it does not bind
    assert found.costs.advised == {"change_max": pytest.approx(2 * change_max)}
    assert found.costs.advised_error.rms == two
    said = " ".join(found.lines(DisplayUnits((1e3, "mm"), (1e6, "µm"))))
    assert f"If the drive allows it: --change_max {2 * change_max:.4g}, with which about" in said
    assert f" is left of {1e6 * one:.4g} µm" in said
    beyond = f"{0.5e6 * change_max:.4g} µm of it cannot be compensated."
    assert f"The largest servo error of the log, {1.5e6 * change_max:.4g} µm, is above change_max: {beyond}" in said
    assert "The log's commands reach 500 mm/s, above v_max = 300 mm/s: where they do, it bounds" in said
    assert "The log's commands reach 2.5e+07 mm/s³, above j_max = 2e+07 mm/s³: where they do, it bounds" in said
    assert "above a_max" not in said
    assert "set change_max to twice that error; motion" in said
    assert "following_error_max is 0: nothing trips." in said


@pytest.mark.skipif(not LOOPS.is_dir(), reason=f"the cases are not at {LOOPS}")
@pytest.mark.parametrize(("change_max", "bound", "most"), [(0.001, {"change_max": 0.0323}, 17), (0.0022, {}, 0.5)])
def test_cosim_says_which_limit_binds_and_what_it_costs(
    hybridsep: Run, tmp_path: Path, change_max: float, bound: dict[str, float], most: float
) -> None:
    limits = ("[drive_limits]", f"[drive_limits]\nchange_max = {change_max}")
    machine = changed_machine(tmp_path / "axis.toml", LOOPS / "axis.toml", limits)
    with gzip.open(LOOPS / "commands.csv.gz") as commands:
        (tmp_path / "commands.csv").write_bytes(commands.read())
    out = hybridsep.done("cosim", "-m", machine, "--compensate", "hybrid", "--json")
    found = json.loads(out)
    assert found["limits_that_bind"] == pytest.approx(bound, abs=1e-3)
    assert found["tracking_rms_um"] < most
    assert (found["limit_costs"] is not None) == bool(bound)
    if bound:
        assert found["limit_costs"]["advised"] == {"change_max": 0.002}
        one, two = (found["limit_costs"]["effects"]["change_max"][factor] for factor in ("1.0", "2.0"))
        assert two["rms"] < 0.1 * one["rms"]
        assert two["largest"] < 0.5 * one["largest"]
    words = "Limits bind the compensated command: change_max in 3.2 % of the samples."
    assert binding_words(bound) == (words if bound else "No limit binds the compensated command.")


def test_all_three_limits_are_needed() -> None:
    assert drive_limits({"period": 0.01}) == {}
    found = drive_limits({"v_max": 1.0, "a_max": 2.0, "j_max": 3.0, "change_max": 1e-4})
    assert found == {"velocity": 1.0, "acceleration": 2.0, "jerk": 3.0, "change_max": 1e-4}
    with pytest.raises(ParameterError, match=r"limits v_max, a_max, j_max; missing: a_max, j_max"):
        drive_limits({"v_max": 1.0})


@pytest.mark.parametrize(
    ("sizes", "off", "advised"),
    [
        ({"change_max": {0.5: 1.0, 1.0: 1.0, 2.0: 1.0}}, 9.0, []),  # half of it costs nothing, and gains nothing
        ({"change_max": {0.5: 2.0, 1.0: 1.0, 2.0: 0.9}}, 9.0, ["change_max"]),
        ({"change_max": {0.5: 2.0, 1.0: 1.0, 2.0: 0.9}}, 200.0, []),  # little is left of the error today
        ({"change_max": {0.5: 2.0, 1.0: 1.0, 2.0: [0.5, 1.1]}}, 9.0, []),  # the largest error rises
        ({"acceleration": {0.5: 2.0, 1.0: 1.0, 2.0: 0.9}, "change_max": {0.5: 3.0, 1.0: 1.0, 2.0: 0.9}}, 9.0, []),
    ],
)
def test_what_is_advised_gains_something(
    sizes: dict[str, dict[float, float | list[float]]], off: float, advised: list[str]
) -> None:
    """Alone and together: in the last case both leave as much as today. ``off`` is the error without compensation."""
    limits = {"velocity": 0.1, "acceleration": 1.0, "jerk": 10.0, "change_max": 1e-3}
    x_d = command()[:200]

    class Drawn(Stretch):
        def expected(self, settings: CompensatorSettings, Np: int) -> Expected:
            assert settings.limits is not None
            assert settings.change_max is not None
            factors = {"acceleration": settings.limits.acceleration, "change_max": settings.change_max / 1e-3}
            changed = [(name, factor) for name, factor in factors.items() if factor != 1.0]
            size = sizes.get(changed[0][0], {}).get(changed[0][1], 1.0) if len(changed) == 1 else 1.0
            return Expected(x_d, np.resize(size, Np), x_d, x_d)

    assert list(Drawn(Trial(axis(limits)), x_d, x_d - off, slice(None)).limit_costs().advised) == advised
