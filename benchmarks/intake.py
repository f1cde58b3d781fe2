"""Faults in many logs, and what the intake says of them and of good logs.

``python -m benchmarks.intake --drives 150`` takes some minutes. The faults come from tests/support/spoiled_logs.py.
The thresholds of the checks were chosen on the logs named here, on the random drives 0 to 399 and on the generated logs
0 to 159 (tests/support/generated_logs.py): ``--first 1000 --spoil 20 --generated 200`` judges them on others. The
thresholds for clipped positions were chosen on the axes 0 to 299 that stand by friction and load
(tests/support/standing_axes.py), and on the recorded arm: ``--only-standing --first 1000 --standing 120`` judges them
on others in a minute.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from generated_logs import generated_log
from places import SO101
from spoiled_logs import FAULTS, GOOD, good, log_of
from standing_axes import clipped_axis, standing_axis

from benchmarks.random_drives.commands import T_S
from benchmarks.random_drives.generator import random_drives
from hybridsep.intake.check import check
from hybridsep.logs.log import Log, read_log

SPOILED = ("staircase", "stage x", "EMPS", "cnc_a_axis1.csv", "cnc_a_axis2.csv", "random drive 3", "random drive 26")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print what is missed, and what is accused."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=150, help="random drives that must not be accused")
    parser.add_argument("--first", type=int, default=0, help="index of the first of them")
    parser.add_argument("--spoil", type=int, default=0, help="how many of them are spoiled, besides the named logs")
    parser.add_argument("--generated", type=int, default=0, help="generated logs, and as many that are spoiled")
    parser.add_argument("--standing", type=int, default=30, help="axes that stand by friction, good and clipped")
    parser.add_argument("--only-standing", action="store_true", help="nothing but these, and the recorded arm")
    options = parser.parse_args(arguments)
    first = options.first
    report_standing(range(first, first + options.standing))
    if options.only_standing:
        return
    report_faults("named logs", ((name, good(name)) for name in SPOILED))
    report_faults("random drives", ((name, log) for name, log, _ in random_logs(first, options.spoil)))
    report_generated(range(first, first + options.generated))
    report("good logs", ((name, good(name), None) for name in GOOD))
    report("random drives", random_logs(first, options.drives))
    report("random drives, with a model that is 20 % wrong", random_logs(first, options.drives, with_model=True))


def report_faults(title: str, logs: Iterable[tuple[str, Log]]) -> None:
    """Print which faults are not found, or not alone, in logs."""
    missed = others = n = 0
    for name, log in logs:
        for fault, (expected, spoil) in FAULTS.items():
            found = [finding.name for finding in check(spoil(log)).findings]
            n += 1
            missed += expected not in found
            others += any(other != expected for other in found)
            if found != [expected]:
                print(f"{name:20} {fault:22} is {expected}, found: {', '.join(found) or 'nothing'}", flush=True)
    print(f"{title}: {n} spoiled, {missed} faults not found, {others} with another finding besides", flush=True)


def report_generated(seeds: Iterable[int]) -> None:
    """Print how many generated logs are refused, and of how many, each spoiled by a fault, it is found."""
    refused = n = 0
    found = {fault: [0, 0] for fault in FAULTS}
    for seed in seeds:
        generated = generated_log(seed)
        intake = check(generated.log)
        errors = [finding.name for finding in intake.errors] + ([] if intake.usable else ["not usable"])
        n, refused = n + 1, refused + bool(errors)
        if errors:
            print(f"{seed}: {generated}: refused: {', '.join(errors)}", flush=True)
        fault = list(FAULTS)[seed % len(FAULTS)]
        expected, spoil = FAULTS[fault]
        log = replace(generated.log, unit="m", unit_stated=False) if expected == "unit" else generated.log
        names = [finding.name for finding in check(spoil(log)).findings]
        found[fault][0] += expected in names
        found[fault][1] += 1
        if expected not in names:
            print(f"{seed}: {generated}: {fault} is {expected}, found: {', '.join(names) or 'nothing'}", flush=True)
    print(f"generated logs: {refused} of {n} good ones refused; found of those spoiled, by fault:")
    print(", ".join(f"{fault} {right} of {all_}" for fault, (right, all_) in found.items() if all_), flush=True)


def report_standing(seeds: Iterable[int]) -> None:
    """Print how many axes that stand by friction and load are refused, and of how many that are clipped it is found."""
    recorded = [(path.stem, read_log(path, uniform=False)) for path in sorted(SO101.glob("*.csv"))]
    refused, noted, n = 0, 0, 0
    for name, log in (*recorded, *((str(seed), standing_axis(seed)) for seed in seeds)):
        intake = check(log)
        errors = [finding.name for finding in intake.errors] + ([] if intake.usable else ["not usable"])
        n, refused = n + 1, refused + bool(errors)
        noted += any(finding.name == "clipped" for finding in intake.findings)
        if errors:
            print(f"standing axis {name}: refused: {', '.join(errors)}", flush=True)
    found = n_clipped = 0
    for seed in seeds:
        errors = [finding.name for finding in check(clipped_axis(seed)).errors]
        n_clipped, found = n_clipped + 1, found + ("clipped" in errors)
        if errors != ["clipped"]:
            print(f"clipped axis {seed}: found: {', '.join(errors) or 'nothing'}", flush=True)
    print(
        f"axes that stand by friction and load, {len(recorded)} of them recorded: {refused} of {n} good ones refused, "
        f"{noted} with a note that they stand at a limit; {found} of {n_clipped} clipped ones found"
    )


def report(title: str, logs: Iterator[tuple[str, Log, Any]]) -> None:
    """Print how many of some good logs are accused, and of what."""
    accused = n = 0
    for name, log, machine in logs:
        found = [finding.name for finding in check(log, machine).findings]
        n, accused = n + 1, accused + bool(found)
        if found:
            print(f"{name:20} accused: {', '.join(found)}", flush=True)
    print(f"{title}: {accused} of {n} accused")


def random_logs(first: int, n: int, *, with_model: bool = False) -> Iterator[tuple[str, Log, Any]]:
    """Yield random drives from an index on, with a machine of their models or none."""
    for drive in random_drives(range(first, first + n)):
        physics = SimpleNamespace(input_hold="zoh")
        machine = SimpleNamespace(model=drive.model, physics=physics, name="nominal", T_s=T_S) if with_model else None
        yield f"random drive {drive.index}", log_of(drive.x_d, drive.x_meas, T_S), machine


if __name__ == "__main__":
    main()
