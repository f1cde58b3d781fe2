"""The Modelica package, written from the paper's equations, beside the plant FMUs."""

import importlib.util
import platform
import sys

import numpy as np
import pytest
from built_once import BuiltFmus

from hybridsep import load_machine

HAS_WHEEL = (sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64")) or (
    sys.platform == "win32" and platform.machine() == "AMD64"
)
"""Whether there is a wheel of rumoca 0.10.2 for this machine; then it must be installed."""

if not HAS_WHEEL and importlib.util.find_spec("rumoca") is None:
    pytest.skip("rumoca has no library for this machine", allow_module_level=True)

import rumoca  # noqa: E402 - only where there is one

from benchmarks import modelica  # noqa: E402

RTOL = 1e-10
BELOW = {"FeedDrive": 1e-11, "FeedDrive_als25010_x": 3e-10, "FeedDrive_als25010_y": 1e-10}
"""Largest difference, m: the error of the FMU's own steps, some times over (``benchmarks/modelica.py``)."""
NAMES = dict(zip(BELOW, modelica.MODELS.items(), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("fmu", "path"), [*zip(BELOW, ("staircase", "staircase", "spiral"), strict=True)])
def test_a_drive_in_modelica_moves_as_its_fmu(fmu: str, path: str, fmus: BuiltFmus) -> None:
    name, model = NAMES[fmu]
    T_s, x_d = load_machine(name).T_s, modelica.commands(name)[path][:600] + 0.3 * (path == "spiral")
    ours = modelica.played(fmus(fmu), x_d, T_s, 1)
    theirs = modelica.simulated(modelica.compiled(f"Machines.{model}", x_d), len(x_d), T_s, RTOL)
    assert np.ptp(ours.x) > 2e-3  # it moves
    assert np.std(ours.x_meas - ours.x) > 0.5e-6  # and is measured with noise
    assert modelica.largest(theirs.x, ours.x) < BELOW[fmu]
    assert modelica.largest(theirs.x_meas, ours.x_meas) < BELOW[fmu]
    assert modelica.largest(theirs.v, ours.v) < 1e3 * BELOW[fmu]  # the fastest mode has 270 rad/s


def test_friction_of_the_motion(fmus: BuiltFmus) -> None:
    """Steep friction costs the FMU's own steps 27 nm; shorter ones come closer."""
    x_d = modelica.commands("als25010_x")["staircase"][:400]
    values = ", ".join(("f = 2e-6", "kappa = 0.0213165", *modes_of("als25010_x")))
    theirs = modelica.simulated(modelica.compiled("Drives.StageInMotion", x_d, values), len(x_d), 1e-3, RTOL)
    coarse, fine = (
        modelica.played(fmus("FeedDrive_als25010_x"), x_d, 1e-3, steps, f=2e-6, friction_on=1, noise_std=0.0)
        for steps in (1, 50)
    )
    assert modelica.largest(theirs.x, coarse.x) < 1e-7
    assert modelica.largest(theirs.x, fine.x) < 5e-9


@pytest.mark.parametrize(("name", "model"), modelica.MODELS.items())
def test_the_packages_machines_have_the_values_of_the_machine_files(name: str, model: str) -> None:
    machine = load_machine(name)
    drive = rumoca.Session().loads(modelica.package(), model=f"HybridSEP.Machines.{model}")
    values = {parameter.name: parameter.value for parameter in drive.parameters}
    assert machine.plant is not None
    expected = machine.plant.values("kind", "friction_on") | {"T_s": machine.T_s}
    if machine.physics.spring_mass_damper is not None:
        expected |= machine.physics.spring_mass_damper.values()
    assert {key: values[key] for key in expected} == expected
    text = modelica.package().partition(f"model {model} =")[2].partition(";")[0]
    assert all(mode in text for mode in modes_of(name))


def test_the_example_runs() -> None:
    drive = rumoca.Session().loads(modelica.package(), model="HybridSEP.Example")
    result = drive.simulate((0.0, 1.0), dt=1e-3, config=rumoca.SimConfig(solver="rk-like", rtol=RTOL, atol=1e-13))
    assert 1e-5 < np.abs(result["e"]).max() < 1e-3  # a drive of 25 Hz follows 1 Hz


def modes_of(machine: str) -> list[str]:
    """Return a machine's modes as the package has them; none of a drive that has no modes of its own."""
    modes = load_machine(machine).physics.mode
    columns = {name: [getattr(mode, name) for mode in modes] for name in ("f_n", "zeta", "alpha", "beta")}
    return [f"{name} = {{{', '.join(map(repr, column))}}}" for name, column in columns.items() if column]
