"""Load times of the library and its command line, beside ``import scipy.signal`` in the same run.

    python benchmarks/start_up.py [--runs 15]

Every run is a process of its own, by turns; medians, with what each of them loads of the modules that are slow to
load. The exit code is 1 if a ratio is missed or a module is loaded before it is used.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

SLOW_MODULES = ("matplotlib", "control", "fmpy", "ruckig", "scipy.spatial", "joblib")
"""Modules that must not be loaded before they are used."""

PEER = "import scipy.signal"


@dataclass(frozen=True)
class Start:
    """Program to start: its code, largest ratio to :data:`PEER`, whether it may load :data:`SLOW_MODULES`."""

    code: str
    most: float | None = None
    may_load: bool = False


STARTS = {
    PEER: Start(PEER, may_load=True),
    "import hybridsep": Start("import hybridsep", 1.25),
    "hybridsep --help": Start(
        "import sys; sys.argv = ['hybridsep', '--help']; from hybridsep.__main__ import main; main()", 1.3
    ),
    "from hybridsep import HybridPredictor": Start("from hybridsep import HybridPredictor", may_load=True),
    "from hybridsep import cosimulate": Start("from hybridsep import cosimulate", may_load=True),
}

LIST_LOADED = "import atexit, json, sys; atexit.register(lambda: print('\\n' + json.dumps(sorted(sys.modules))))\n"


def seconds(code: str) -> float:
    """Return the time of a process that runs the code, s."""
    begin = time.perf_counter()
    run(code)
    return time.perf_counter() - begin


def loaded(code: str) -> list[str]:
    """Return which of the slow modules the code loads."""
    modules = json.loads(run(LIST_LOADED + code).splitlines()[-1])
    return [module for module in SLOW_MODULES if module in modules]


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=15, help="processes of each")
    options = parser.parse_args()
    times: dict[str, list[float]] = {name: [] for name in STARTS}
    for start in STARTS.values():
        seconds(start.code)  # the files are in the system's cache, compiled
    for _ in range(options.runs):
        for name, start in STARTS.items():
            times[name].append(seconds(start.code))
    peer = statistics.median(times[PEER])
    missed = False
    for name, start in STARTS.items():
        median, modules = statistics.median(times[name]), loaded(start.code)
        held = (start.most is None or median <= start.most * peer) and (start.may_load or not modules)
        missed |= not held
        limit = f"at most {start.most:g}" if start.most is not None else ""
        verdict = "" if held else "MISSED"
        print(f"{name:<40}{median:6.2f} s{median / peer:7.2f}  {limit:<14}{verdict:<8}{', '.join(modules) or '–'}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
