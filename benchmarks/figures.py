"""Figures of README and docs/ that do not depend on the machine's speed: written to JSON, or compared.

    python -m benchmarks.figures --out FILE [--emps PATH]      (some ten minutes)
    python -m benchmarks.figures --compare FILE [--emps PATH]

A change of structure changes no figure: written before it and compared after it, to the printed digits. The exit code
is 1 if one differs. Times and instruction counts stay with the benchmarks that measure them.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = (
    ("examples/section_3_1.py",),
    ("examples/section_3_2.py",),
    ("examples/section_4_2.py",),
    ("examples/calibrate_stage.py",),
    ("-m", "benchmarks.compensation.run"),
)
"""Programs whose printed lines are figures."""

DECIMALS = 2
"""Decimals of the demo's figures, µm and %, as README prints them."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--out", type=Path, help="file to write")
    action.add_argument("--compare", type=Path, help="file to compare with")
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat: the recorded axis, too")
    options = parser.parse_args()
    expected = None if options.compare is None else json.loads(options.compare.read_text(encoding="utf-8"))
    figures = {"demo": demo(options.emps), **{" ".join(script): printed(script) for script in SCRIPTS}}
    if expected is None:
        options.out.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return 0
    differences = list(compared(expected, figures))
    print("\n".join(differences) or "no figure differs")
    return int(bool(differences))


def demo(emps: Path | None) -> Any:
    """Return the full demo's summary, rounded."""
    with TemporaryDirectory() as out:
        command = [sys.executable, "-c", "from hybridsep.app.cli import main; main()"]
        run([*command, "demo", "--full", "--out", out])
        found = json.loads((Path(out) / "summary.json").read_text(encoding="utf-8"))
        if emps is not None:
            paper = ("--set", "predictor.averaging=false", "--set", "predictor.t_init=1.242")
            found["emps"] = json.loads(run([*command, "backtest", str(emps.resolve()), "-m", "emps", *paper, "--json"]))
        return rounded(found)


def printed(script: tuple[str, ...]) -> list[str]:
    """Return the lines that a program prints."""
    return run([sys.executable, *script]).splitlines()


def run(command: list[str]) -> str:
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    done = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 1):  # 1: a limit is missed, which its lines say
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}")
    return done.stdout


def rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DECIMALS)
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    return [rounded(item) for item in value] if isinstance(value, list) else value


def compared(expected: Any, got: Any, place: str = "") -> Iterator[str]:
    """Yield a line for each figure that differs, with its place."""
    if isinstance(expected, Mapping) and isinstance(got, Mapping):
        for key in {**expected, **got}:
            yield from compared(expected.get(key), got.get(key), f"{place}/{key}")
    elif isinstance(expected, list) and isinstance(got, list) and len(expected) == len(got):
        for i, (before, now) in enumerate(zip(expected, got, strict=True), start=1):
            yield from compared(before, now, f"{place}:{i}")
    elif expected != got:
        yield f"{place.lstrip('/')}\n  before {expected}\n  now    {got}"


if __name__ == "__main__":
    sys.exit(main())
