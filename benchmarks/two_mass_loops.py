"""Benchmark of compensation in closed loop: the native SepCompensator on drives of two masses, sound and not.

    python -m benchmarks.two_mass_loops [--n 60] [--seed 2] [--only TEXT]      (ten minutes)

Tracking RMS of the true position without compensation, with the physics model's plans and with the hybrid's, cold, over
the whole run and from 1 s on. The physics model's plans do not depend on what is measured.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from two_mass.generator import SEED, Recipe
from two_mass.loop import CONDITIONS, SOUND, closed_loop, settings_of
from two_mass.plant import TwoMassDrive

from hybridsep.base.metrics import largest, peak_derivatives
from hybridsep.base.signals import Array

LATE = 1.0
"""Time after which the second figures count, s."""

KEPT = 1e-9
"""Share by which a limit may be exceeded: rounding."""

UM = 1e6


@dataclass(frozen=True)
class Result:
    """Tracking RMS of a drive under a condition, m, over the whole run and from 1 s on.

    Attributes
    ----------
    index : int
    condition, text : str
    none, physics, hybrid : tuple of two floats, m
        Infinite where the compensator refused to go on.
    excess : float
        By how much the hybrid's command exceeds a limit of the drive, relative to it; ≤ 0: by nothing.
    """

    index: int
    condition: str
    text: str
    none: tuple[float, float]
    physics: tuple[float, float]
    hybrid: tuple[float, float]
    excess: float

    def over_physics(self, part: int) -> float:
        """RMS relative to the physics model's plans."""
        return self.hybrid[part] / self.physics[part]

    def over_better(self, part: int) -> float:
        """RMS relative to the better of those plans and none."""
        return self.hybrid[part] / min(self.physics[part], self.none[part])

    def over_worse(self, part: int) -> float:
        """RMS relative to the worse of the two."""
        return self.hybrid[part] / max(self.physics[part], self.none[part])

    def __str__(self) -> str:
        figures = "  ".join(
            " / ".join(f"{UM * rms[part]:.4g}" for rms in (self.none, self.physics, self.hybrid)) for part in (0, 1)
        )
        return f"{self.condition}: {figures} µm: drive {self.index}, {self.text}"


def results(index: int, seed: int, only: str = "") -> list[Result]:
    """Return the results of a drive under each condition whose name has a text."""
    recipe = Recipe.draw(index, seed)
    _, compensator, x_d = settings_of(recipe)
    T_s, start = recipe.axis.T_s, float(x_d[0])
    planned = closed_loop(recipe, recipe.axis, "physics").x_dm
    found = []
    for name, condition in CONDITIONS.items():
        if only not in name:
            continue
        axis = condition.axis(recipe.axis, x_d)
        alone = [TwoMassDrive(axis, start).run(command) for command in (x_d, planned)]
        hybrid = closed_loop(recipe, axis, "hybrid", condition.sensor(x_d, T_s))
        assert compensator.limits is not None
        assert compensator.change_max is not None
        limits = (compensator.limits.velocity, compensator.limits.acceleration, compensator.limits.jerk)
        sent = hybrid.x_dm[np.isfinite(hybrid.x_dm)]
        excess = [peak / limit - 1 for peak, limit in zip(peak_derivatives(sent, T_s), limits, strict=True)]
        excess.append(largest(sent - x_d[: len(sent)]) / compensator.change_max - 1)
        rms = [_tracking_rms(x_d - x, T_s) for x in (*alone, hybrid.x)]
        found.append(Result(index, name, recipe.description, rms[0], rms[1], rms[2], max(excess)))
    return found


def _tracking_rms(error: Array, T_s: float) -> tuple[float, float]:
    """Return the RMS of a tracking error, m, over the whole run and from 1 s on; infinite where it is not known."""
    whole, late = (float(np.sqrt(np.mean(part**2))) for part in (error, error[round(LATE / T_s) :]))
    return (whole, late) if np.isfinite(whole) else (np.inf, np.inf)


def rows(found: Sequence[Result]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield f"{len({r.index for r in found})} drives; hybrid relative to the physics model's plans over the whole run,"
    yield "to the better of these and none from 1 s on, and to the worse of the two over the whole run"
    groups = ("× physics", "× better, from 1 s", "× worse")
    columns = (("median", "95 %", "worst"), ("median", "90 %", "99 %", "worst"), ("99 %", "worst"))
    heading = "".join(f"{group:>{9 * len(names)}}" for group, names in zip(groups, columns, strict=True))
    yield f"{'':26}{heading}{'limits':>9}"
    yield f"{'':26}" + "".join(f"{name:>9}" for names in columns for name in names) + f"{'kept':>9}"
    for name in (*CONDITIONS, "all"):
        group = [r for r in found if name in (r.condition, "all")]
        if not group:
            continue
        parts = (
            ([r.over_physics(0) for r in group], (0.5, 0.95, 1.0)),
            ([r.over_better(1) for r in group], (0.5, 0.9, 0.99, 1.0)),
            ([r.over_worse(0) for r in group], (0.99, 1.0)),
        )
        cells = [
            f"{value:9.3g}"
            for ratios, levels in parts
            for value in np.quantile(ratios, levels, method="inverted_cdf").tolist()
        ]
        kept = np.mean([r.excess <= KEPT for r in group])
        yield f"{name:26}" + "".join(cells) + f"{100 * kept:7.1f} %"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--first", type=int, default=0, help="index of the first drive")
    parser.add_argument("--n", type=int, default=60, help="number of drives")
    parser.add_argument("--only", default="", help="only the conditions whose name has this text")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    chosen = parser.parse_args(arguments)
    found: list[Result] = []
    with ProcessPoolExecutor(chosen.processes, get_context("spawn")) as pool:
        indices = range(chosen.first, chosen.first + chosen.n)
        for of_drive in pool.map(partial(results, seed=chosen.seed, only=chosen.only), indices):
            found += of_drive
            print(f"drive {of_drive[0].index}: × physics " if of_drive else "", end="")
            print(" ".join(f"{r.over_physics(0):.3g}" for r in of_drive), flush=True)
    for line in rows(found):
        print(line)
    for title, key in (("sound, × physics", _of_sound), ("from 1 s on, × the better", _late), ("× the worse", _whole)):
        print(f"worst {title}; none / physics / hybrid, whole run and from 1 s on:")
        for r in sorted(found, key=key)[-5:]:
            print(f"  {r}")


def _of_sound(r: Result) -> float:
    return r.over_physics(0) if r.condition == SOUND else 0.0


def _late(r: Result) -> float:
    return r.over_better(1)


def _whole(r: Result) -> float:
    return r.over_worse(0)


if __name__ == "__main__":
    main()
