"""Step time of the native SepCompensator in closed loop, beside HybridPredictor in the same run.

Builds two C hosts (``main.c``): the compensator with the drive of eq. (13), and the predictor over the drive's log,
both with the paper's settings; then the compensator with averaging and the settings of its machine file. Times every
step of both by turns, counts instructions step by step where valgrind is installed, and ends with 1 if a limit is
missed.
Within the trajectory's limits nearly every plan is bounded, which is the most that planning can
cost.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.step_time.host import PREDICTOR, Array, Host, build, instructions, longest_step, timed, warm
from hybridsep.base.settings import CompensatorSettings, Limits
from hybridsep.cosim.loop import cosimulate
from hybridsep.machines.machine import load_machine
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

_LIMITS = Limits(velocity=0.1, acceleration=16.0, jerk=5000.0)
_SETTINGS = CompensatorSettings(
    preview=200, spacing=2, jerk_weight=1.0, change_max=1e-3, no_reversal=True, compensate="hybrid", limits=_LIMITS
)
COMPENSATOR = {**PREDICTOR, **_SETTINGS.to_fmi()}
PAPER = "the paper's settings"
AVERAGING = {"averaging": 1, "Np": 50, "t_init": -1.0}
WITH_AVERAGING, TIGHT_WITH_AVERAGING = "with averaging", "with averaging, limits of the trajectory"
WARM, TIGHT_WARM = "with averaging, warm", "with averaging, limits of the trajectory, warm"
TIGHT = {"v_max": 0.08, "a_max": 8.0, "j_max": 1000.0}
CASES: dict[str, dict[str, Any]] = {
    PAPER: {},
    "limits of the drive = those of the trajectory": TIGHT,
    WITH_AVERAGING: AVERAGING,
    TIGHT_WITH_AVERAGING: {**AVERAGING, **TIGHT},
}
REPETITIONS, COUNTED_STEPS = 5, 3500
TAIL_MAX = 300e3
"""Limit of p99.9, ns."""
MEDIAN_OVER_PREDICTOR_MAX = 2.0
AVERAGING_MEDIAN_MAX = 6.0
"""Limit of the median with averaging, relative to the paper's settings."""
AVERAGING_MOST = 2e6
"""Limit of the instructions of the most expensive step with averaging."""
AVERAGING_LONGEST = 0.5
"""Limit of the longest step with averaging, if nothing interrupts it, relative to T_s."""


def summaries(hosts: dict[str, tuple[Host, dict[str, Any]]], steps: int, folder: Path) -> dict[str, dict[str, Any]]:
    """Run all hosts by turns; return the medians of each one's figures over the turns, and the longest step of all."""
    turns: dict[str, list[dict[str, Any]]] = {name: [] for name in hosts}
    times: dict[str, list[Array]] = {name: [] for name in hosts}
    for _ in range(REPETITIONS):
        for name, (host, values) in hosts.items():
            printed, (of_steps, _) = timed(host, values, steps, folder)
            turns[name].append(printed)
            times[name].append(of_steps)
    return {
        name: {
            **{key: statistics.median(turn["step"][key] for turn in found) for key in found[0]["step"]},
            "longest": longest_step(times[name]),
            "state_bytes": found[0]["state_bytes"],
            "rms_e": found[0].get("rms_e"),
            "empty": statistics.median(turn["empty"]["p99.9"] for turn in found),
        }
        for name, found in turns.items()
    }


def trained() -> HybridPredictor:
    """Return the predictor of the drive's compensator after a part of the staircase, in closed loop."""
    machine = load_machine("spring_mass_damper")
    compensator = machine.new_compensator()
    cosimulate(compensator, machine.new_plant(), staircase()[:2500], encoder=Encoder(5e-6, 7))
    return compensator.predictor


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=120_000, help="steps of each turn")
    options = parser.parse_args()
    console, missed = Console(width=120), 0
    with tempfile.TemporaryDirectory(prefix="hsep_step_time_") as name:
        folder = Path(name)
        predictor = build(folder / "predictor", "HybridPredictor", PREDICTOR)
        compensator = build(folder / "compensator", "SepCompensator", COMPENSATOR)
        hosts: dict[str, tuple[Host, dict[str, Any]]] = {"HybridPredictor": (predictor, {})}
        begun = warm(trained(), folder / "warm")
        cases = CASES | {WARM: CASES[WITH_AVERAGING] | begun, TIGHT_WARM: CASES[TIGHT_WITH_AVERAGING] | begun}
        hosts |= {case: (compensator, values) for case, values in cases.items()}
        found = summaries(hosts, options.steps, folder)
        counts: dict[str, Array] = {}
        for i, (case, (host, values)) in enumerate(hosts.items()):
            counted = instructions(host, values, COUNTED_STEPS, folder / f"callgrind_{i}")
            if counted is not None:
                counts[case] = counted[int(COMPENSATOR["preview"]) :]
    table = Table(title="one step: ns, and instructions in thousands; p = 50, q = 3, Np = 100")
    for heading in ("", "median", "p99", "p99.9", "longest", "instr. median", "p99", "p99.9", "most", "state, kB"):
        table.add_column(heading, justify="right" if heading else "left")
    for case, figures in found.items():
        times = [f"{figures[key]:.0f}" for key in ("median", "p99", "p99.9", "longest")]
        shown = ["–"] * 4
        if case in counts:
            shown = [f"{level / 1e3:.1f}" for level in np.percentile(counts[case], [50, 99, 99.9, 100])]
        table.add_row(case, *times, *shown, f"{figures['state_bytes'] / 1e3:.0f}")
    console.print(table)
    checks = []
    ours, ratio = found[PAPER], found[PAPER]["median"] / found["HybridPredictor"]["median"]
    text = f"{PAPER}: p99.9 = {ours['p99.9'] / 1e3:.0f} µs, limit ≤ {TAIL_MAX / 1e3:g} µs"
    checks.append((ours["p99.9"] <= TAIL_MAX, text))
    text = f"{PAPER}: median / HybridPredictor's median = {ratio:.2f}, limit ≤ {MEDIAN_OVER_PREDICTOR_MAX:g}"
    checks.append((ratio <= MEDIAN_OVER_PREDICTOR_MAX, text))
    for case in (WITH_AVERAGING, TIGHT_WITH_AVERAGING, WARM, TIGHT_WARM):
        ratio = found[case]["median"] / found[PAPER]["median"]
        text = f"{case}: median / that of {PAPER} = {ratio:.2f}, limit ≤ {AVERAGING_MEDIAN_MAX:g}"
        checks.append((ratio <= AVERAGING_MEDIAN_MAX, text))
        longest, interrupted = found[case]["longest"] * 1e-9 / float(COMPENSATOR["T_s"]), found[case]["max"] / 1e3
        text = (
            f"{case}: longest step {longest:.2f} T_s, limit ≤ {AVERAGING_LONGEST:g} "
            f"(with what interrupts it {interrupted:.0f} µs)"
        )
        checks.append((longest <= AVERAGING_LONGEST, text))
        if case in counts:
            most = counts[case].max()
            text = (
                f"{case}: most expensive step {most / 1e6:.1f} million instructions, limit ≤ {AVERAGING_MOST / 1e6:g}"
            )
            checks.append((bool(most <= AVERAGING_MOST), text))
    for held, text in checks:
        console.print(f"{'held  ' if held else 'MISSED'} {text}", highlight=False)
        missed += not held
    if not counts:
        console.print("instructions are not counted: valgrind is not installed", highlight=False)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
