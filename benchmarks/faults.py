"""Benchmark of the following-error monitor: native compensators whose sensor or drive fails, and sound ones.

    python -m benchmarks.faults [--n 40] [--seed 51] [--sound 300] [--without]      (ten minutes, one process)
    python -m benchmarks.faults --only saturated --force 1.15

Drives of two masses at up to 2 kHz, cold and hybrid; the fault begins in motion after 0.4 of a run, or with it, and
lasts until its end. RMS and largest error of the true position from the fault on, relative to the drive without
compensation, and time from the fault, or from when the axis has moved by ``following_error_max`` since, to the trip,
ms. A trip of a sound loop is false if its error is below the largest one without compensation.
"""

import argparse
import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count, islice
from pathlib import Path

import numpy as np
from two_mass.axis import Axis
from two_mass.generator import Recipe
from two_mass.plant import TwoMassDrive

from benchmarks.two_mass_loops import CHANGE, CONDITIONS, closed_loop, machine_of_drive, trajectory
from hybridsep.base.metrics import largest, rms
from hybridsep.base.signals import Array
from hybridsep.fmi.archive import build_here
from hybridsep.online.look_ahead import SepState

MARGIN = 1.3  # ``following_error_max`` relative to the largest error without compensation, as ``fit`` writes it
FASTEST = 2000.0  # largest sampling rate, Hz: faster loops take up to half a minute each
HARMED, PEAK = 1.2, 1.5  # largest RMS and largest error that count as no harm, relative to no compensation

Fault = Callable[[float, float, float], float]
"""Called as ``fault(x_meas, held, x_d)`` with what was measured before it began; returns what is measured, m."""

SENSORS: dict[str, Fault] = {
    "frozen": lambda x, held, x_d: held,
    "mirrored": lambda x, held, x_d: 2 * held - x,
    "reversed": lambda x, held, x_d: -x,
    "wrong sign": lambda x, held, x_d: -x,
    "wrong error": lambda x, held, x_d: 2 * x_d - x,
    "zeros": lambda x, held, x_d: 0.0,
    "missing 1 s": lambda x, held, x_d: math.nan,
}
"""Mirrored: counts backwards. Reversed, wrong sign: of the position. Wrong error: of the following error."""

AT_ONCE = ("sound", "wrong sign", "wrong error", "saturated")  # what is so from the beginning

DRIVES = {"saturated": "motor saturated at 0.6", "ringing": "begins to ring"}


def drives(seed: int) -> Iterator[Recipe]:
    """Yield drives that are slow enough."""
    return (recipe for recipe in (Recipe.draw(i, seed) for i in count()) if recipe.axis.T_s >= 1 / FASTEST)


def in_motion(x_d: Array) -> int:
    """Return the first sample after :data:`CHANGE` of a run at half the largest velocity."""
    first, velocity = round(CHANGE * len(x_d)), np.abs(np.diff(x_d))
    return first + int(np.argmax(velocity[first:] >= velocity.max() / 2))


def asked_for(axis: Axis, x_d: Array) -> float:
    """Return the largest force that a drive asks of its motor without compensation, N/kg, static friction included."""
    drive, forces = TwoMassDrive(axis, float(x_d[0])), [0.0]
    for command in x_d.tolist():
        drive.step(command)
        forces.append(drive._drive[-9])  # x[FORCE], before the last eight numbers of drive.c's struct
    return largest(np.array(forces))


def judged(recipe: Recipe, name: str, monitored: bool, force: float = 0.0) -> tuple[float, float, float, bool]:
    """Return RMS and largest error relative to no compensation, ms until a trip (inf: none), and if it was false."""
    machine, x_d, axis = machine_of_drive(recipe), trajectory(recipe), recipe.axis
    first = 0 if name in AT_ONCE else in_motion(x_d)
    if name in DRIVES:
        axis = replace(axis, force_max=force * asked_for(axis, x_d)) if force else CONDITIONS[DRIVES[name]](axis, x_d)
        first = min(first, round(CHANGE * len(x_d)))
    fault, held, end = SENSORS.get(name), 0.0, first + round(1.0 / axis.T_s) if "1 s" in name else len(x_d)

    def sensor(k: int, x_meas: float) -> float:
        nonlocal held
        if fault is None or not first <= k < end:
            held = x_meas
            return x_meas
        return fault(x_meas, held, float(x_d[k]))

    sound = TwoMassDrive(recipe.axis, float(x_d[0])).run(x_d)
    allowed = MARGIN * largest(x_d - sound) if monitored else 0.0
    with tempfile.TemporaryDirectory() as folder:
        fmu = build_here(machine, "SepCompensator", Path(folder))
        loop = closed_loop(fmu, machine, recipe, axis, "hybrid", sensor, following_error_max=allowed)
    off = (x_d - TwoMassDrive(axis, float(x_d[0])).run(x_d))[first:]
    error, tripped = (x_d - loop.x)[first:], np.flatnonzero(loop.state[first:] == SepState.TRIPPED)
    moved = int(np.argmax(np.abs(x_d[first:] - x_d[first]) > allowed))
    after = 1e3 * axis.T_s * max(0, tripped[0] - moved) if len(tripped) else math.inf
    false = name == "sound" and len(tripped) > 0 and abs(error[tripped[0] - 1]) <= largest(off)
    return rms(error) / rms(off), largest(error) / largest(off), after, false


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=51)
    parser.add_argument("--n", type=int, default=40, help="number of drives for each fault")
    parser.add_argument("--sound", type=int, default=300, help="number of sound drives")
    parser.add_argument("--only", default="", help="only the faults whose name has this text")
    parser.add_argument("--without", action="store_true", help="without the monitor")
    parser.add_argument("--force", type=float, default=0.0, help="of saturated motors, in what drives ask for")
    chosen = parser.parse_args(arguments)
    recipes = list(islice(drives(chosen.seed), max(chosen.n, chosen.sound)))
    print(f"{'':14}{'RMS':^25}{'largest error':^25}{'trips':^33}")
    heading = (f"> {HARMED}", "median", "worst", f"> {PEAK}", "median", "worst", "all", "false", "ms", "longest")
    print(" " * 14 + "".join(f"{one:>8}" for one in heading))
    for name in ("sound", *SENSORS, *DRIVES):
        if chosen.only not in name:
            continue
        n = chosen.sound if name == "sound" else chosen.n
        found = np.array([judged(recipe, name, not chosen.without, chosen.force) for recipe in recipes[:n]])
        cells = []
        for ratios, most in zip(found.T[:2], (HARMED, PEAK), strict=True):
            harmed = int(np.sum(~(ratios <= most)))
            cells += [f"{harmed:8d}{np.median(ratios):8.2f}{np.max(ratios):8.2f}"]
        trips = found[np.isfinite(found[:, 2]), 2]
        when = f"{np.median(trips):8.0f}{np.max(trips):8.0f}" if len(trips) else ""
        print(f"{name:14}{''.join(cells)}{len(trips):8d}{int(found[:, 3].sum()):8d}{when}", flush=True)


if __name__ == "__main__":
    main()
