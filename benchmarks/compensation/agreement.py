"""Agreement of the library's compensator and the C core's, in closed loop with random parameters.

    python benchmarks/compensation/agreement.py [--sets 100] [--first 0] [--trust]

Each set has a machine, parameters, moves and noise of its own; two drives are run, one behind each implementation.
Where ``x_dm`` differs by more than 1 nm, the C core is run again with its two inputs changed by 1e-15 of themselves, at
random: if it then differs by more than 1 nm from itself, something amplifies rounding, the loop or the solver in it.
The exit code is 1 if a set differs that does not amplify, or two models plan a window.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# the C core is built and driven as in the tests
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))

import numpy as np
from c_core import library
from numpy.typing import NDArray
from random_loops import MACHINES, Loop, random_loop, run_c, run_library

AGREED = 1e-9
"""Largest difference of x_dm, m."""

PERTURBATION = 1e-15
"""Largest relative change of an input in the repeated run."""


@dataclass(frozen=True)
class Comparison:
    """Result of one set: largest differences of ``x_dm``, m.

    Attributes
    ----------
    apart : float
        Of the library and the C core.
    own : float
        Of the C core and itself with perturbed inputs; 0 if that was not run.
    growth : float
        Mean factor of the latter from one window to the next.
    states_differ : bool
        Whether ``sep_state`` differs anywhere.
    """

    seed: int
    loop: Loop
    apart: float
    own: float
    growth: float
    states_differ: bool


def compare(seed: int, trust: bool) -> Comparison:
    loop = random_loop(seed, trust=trust)
    (x_library, states_library), (x_c, states_c) = run_library(loop), run_c(loop)
    apart = float(np.max(np.abs(x_library - x_c)))
    own, growth = 0.0, 1.0
    if apart > AGREED:
        difference = np.abs(run_c(loop, PERTURBATION)[0] - x_c)
        own, growth = float(np.max(difference)), growth_per_window(difference, loop.values["Np"])
    return Comparison(seed, loop, apart, own, growth, not np.array_equal(states_library, states_c))


def growth_per_window(difference: NDArray[np.float64], Np: int) -> float:
    """Return the mean factor between consecutive windows, from the first difference to the largest one."""
    n = len(difference) // Np
    largest = difference[: n * Np].reshape(n, Np).max(axis=1)
    first, last = int(np.argmax(largest > 0)), int(np.argmax(largest))
    return float((largest[last] / largest[first]) ** (1 / (last - first))) if last > first else 1.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=int, default=100, help="random parameter sets")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--trust", action="store_true", help="plan with the trusted model instead of the paper's")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.sets)
    agreed, amplified, failed = 0, 0, 0
    for machine in MACHINES:
        library(f"compensator_{machine}")  # built once, before there are several processes
    with ProcessPoolExecutor() as pool:
        for found in pool.map(partial(compare, trust=options.trust), seeds):
            if found.apart <= AGREED and not found.states_differ:
                agreed += 1
                continue
            explained = found.own > AGREED
            amplified, failed = amplified + explained, failed + (not explained)
            changed = {name: f"{found.loop.values[name]:.3g}" for name in ("Np", "preview", "spacing", "change_max")}
            print(
                f"set {found.seed}, {found.loop.machine}: {1e9 * found.apart:.3g} nm from the library, "
                f"{1e9 * found.own:.3g} nm from itself, by {found.growth:.2g} a window"
                f"{', with other states' if found.states_differ else ''}; {changed}"
                f"{'' if explained else '   MISSED'}",
                flush=True,
            )
    print(f"{agreed} of {len(seeds)} sets within 1 nm, {amplified} that amplify rounding, {failed} missed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
