"""The Modelica package ``models/HybridSEP.mo``, simulated by rumoca, beside the plant FMUs.

    python -m benchmarks.modelica     (a minute)

The package is written from the paper's equations, the FMUs integrate by fixed steps: where both come to the same
positions, neither has a term wrong. The FMUs are stepped at the sampling interval, and at a fiftieth of it, which
makes their own error of integration vanish. The exit code is 1 if a limit is missed.
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rumoca

from hybridsep.base.files import data_folder
from hybridsep.base.signals import Array
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.spec import fmu_name
from hybridsep.machines.machine import load_machine
from hybridsep.plants.trajectory import spiral, staircase

MODELS = {"spring_mass_damper": "SpringMassDamper", "als25010_x": "ALS25010X", "als25010_y": "ALS25010Y"}
"""Machines and their models in ``HybridSEP.Machines``."""

TOLERANCES = (1e-6, 1e-9, 1e-12)
"""Relative tolerances of rumoca's solver; the absolute ones are a thousandth of them, in m and m/s."""

STEPS = (1, 50)  # communication steps of an FMU within one sampling interval
LIMIT = 1e-12  # largest difference of a position at the tightest tolerance from an FMU with short steps, m


@dataclass(frozen=True)
class Motion:
    """Trajectory of a drive: true and measured positions, m, and true velocities, m/s, each (n,), at the samples."""

    x: Array
    x_meas: Array
    v: Array


def package() -> str:
    """Return the text of the Modelica package."""
    return (data_folder("models") / "HybridSEP.mo").read_text(encoding="utf-8")


def commands(machine: str) -> dict[str, Array]:
    """Return the paper's trajectories of a machine's axis, each (n,), m."""
    return {"staircase": staircase(), "spiral": spiral()[machine.endswith("_y")]}


def compiled(model: str, x_d: Array, values: str = "") -> Any:
    """Return rumoca's model of a drive that gets samples.

    Parameters
    ----------
    model : str
        Name in the package.
    x_d : (n,) array, m
        Commanded positions.
    values : str
        Modification of the drive, as Modelica has it.
    """
    samples = ", ".join(map(repr, x_d.tolist()))
    drive = ", ".join(filter(None, (f"start = {float(x_d[0])!r}", values)))
    text = f"""
model Bench
  HybridSEP.Samples reference(samples = {{{samples}}});
  HybridSEP.{model} drive({drive});
equation
  connect(reference.r, drive.x_d);
end Bench;
"""
    return rumoca.Session().loads(package() + text, model="Bench")


def simulated(model: Any, n: int, T_s: float, rtol: float) -> Motion:
    """Return the motion of a :func:`compiled` model of ``n`` samples by rumoca's explicit solver."""
    config = rumoca.SimConfig(solver="rk-like", rtol=rtol, atol=1e-3 * rtol)
    result = model.simulate((0.0, (n - 1) * T_s), dt=T_s, config=config)
    # Every sample is an event with a row before and a row after it; FMUs show the velocity before it.
    after = np.searchsorted(np.asarray(result.time), (np.arange(n) + 0.5) * T_s) - 1
    before = np.maximum(after - 1, 0)
    x, x_meas, v = (np.asarray(result[f"drive.{name}"]) for name in ("x", "x_meas", "v"))
    return Motion(x[after], x_meas[after], np.append(0.0, v[before[1:]]))


def played(path: Path, x_d: Array, T_s: float, steps: int, **values: float) -> Motion:
    """Return the motion of a plant FMU with ``steps`` communication steps in each sampling interval."""
    rows = np.empty((len(x_d), 3))
    h = T_s / steps
    with FmuInstance(path) as fmu:
        fmu.initialise({"x_d": float(x_d[0]), **values})
        read = fmu.reader(("x", "x_meas", "v"))
        for k, command in enumerate(x_d.tolist()):
            rows[k] = read()
            fmu.set("x_d", command)
            for i in range(steps):
                fmu.step(k * T_s + i * h, h)
    return Motion(*rows.T)


def largest(a: Array, b: Array) -> float:
    """Return the largest difference of two signals."""
    return float(np.abs(a - b).max())


def main() -> int:
    print("| machine | trajectory | rtol | difference from the FMU, m | with steps of T_s/50, m | v, m/s | x_meas, m |")
    print("|---|---|---|---|---|---|---|")
    missed = False
    for name, model in MODELS.items():
        machine = load_machine(name)
        with tempfile.TemporaryDirectory() as folder:
            drive_fmu = fmu_name("FeedDrive", name, "native")
            fmu = build_fmu(machine, drive_fmu, Path(folder), targets=("host",))
            for path, x_d in commands(name).items():
                coarse, fine = (played(fmu, x_d, machine.T_s, steps) for steps in STEPS)
                for rtol in TOLERANCES:
                    drive = simulated(compiled(f"Machines.{model}", x_d), len(x_d), machine.T_s, rtol)
                    off, exact = largest(drive.x, coarse.x), largest(drive.x, fine.x)
                    v, x_meas = largest(drive.v, coarse.v), largest(drive.x_meas, coarse.x_meas)
                    missed |= rtol == TOLERANCES[0] and off > rtol * float(np.ptp(x_d))
                    missed |= rtol == TOLERANCES[-1] and exact > LIMIT
                    print(
                        f"| {name} | {path} | {rtol:g} | {off:.1e} | {exact:.1e} | {v:.1e} | {x_meas:.1e} |", flush=True
                    )
    print("MISSED" if missed else "all limits held")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
