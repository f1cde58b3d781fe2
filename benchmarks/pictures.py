"""Pictures of ``docs/pictures`` and the figures on them, made anew from the commands that the pages name.

    python -m benchmarks.pictures [--only fit_report.png] [--chromium PATH]

``pictures.json`` beside them keeps each picture's hash and the figures that it shows; ``tests/documents`` compares both
with what the commands give now, so that a picture older than its figures is told. Report and live view need
Chromium, Debian's package or any other. Some five minutes for all.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hybridsep.cosim.compensated import COMPENSATED

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "pictures"
RECORD = FOLDER / "pictures.json"
DIGITS = 4  # significant digits of the figures that are kept

REPORT_SIZE = (1000, 900)

Figures = dict[str, float]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", help="a picture's name: it, and those that come with it")
    parser.add_argument("--chromium", default=shutil.which("chromium") or "chromium")
    given = parser.parse_args(arguments)
    record = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for names, make in MAKERS.items():
            if given.only in (None, *names):
                made, figures = make(folder, given.chromium)
                for name, source in made.items():
                    shutil.copyfile(source, FOLDER / name)
                    record[name] = {"sha256": digest(FOLDER / name), "figures": figures}
                print(", ".join(names), flush=True)
    ordered = {name: record[name] for name in sorted(record)}
    RECORD.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def digest(path: Path) -> str:
    """Return a file's SHA-256."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


Made = tuple[dict[str, Path], Figures]


def demonstration(folder: Path, chromium: str) -> Made:
    """Make the pictures of the demonstration."""
    hybridsep(folder, "demo", "--out", "first")  # of the noise seed that the pictures show
    hybridsep(folder, "demo", "--full", "--out", "demo")
    out = folder / "demo"
    names = ("staircase.png", "staircase_compensated.png", "spiral_y.png", "spiral_contour.png")
    summary = json.loads((folder / "first" / "summary.json").read_text(encoding="utf-8"))
    return {name: out / name for name in names}, demonstrated(summary)


def demonstrated(summary: dict[str, Any]) -> Figures:
    """Return the RMS and largest tracking errors, µm, on the staircase's picture, from ``summary.json``."""
    cases = {key: case for key, case in summary["staircase"]["compensation"].items() if key in COMPENSATED}
    sizes = {"": "tracking_rms_um", ", largest": "tracking_max_um"}
    return {key + of: rounded(case[size]) for key, case in cases.items() for of, size in sizes.items()}


def fitted(folder: Path, chromium: str) -> Made:
    """Make the picture of the fit of the example log: the first part of its report."""
    hybridsep(folder, "example-log", "--out", "my_axis.csv")
    hybridsep(folder, "fit", "my_axis.csv", "--Np", "100")
    width, height = REPORT_SIZE
    report = (folder / "my_axis" / "report.html").as_uri()
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=10000")
    look = [chromium, *options, f"--window-size={width},{height}", "--screenshot=fit_report.png", report]
    subprocess.run(look, cwd=folder, check=True, capture_output=True)
    judged = json.loads((folder / "my_axis" / "fit.json").read_text(encoding="utf-8"))["judged"]
    return {"fit_report.png": folder / "fit_report.png"}, judged_figures(judged)


def judged_figures(judged: dict[str, Any]) -> Figures:
    """Return RMS and largest errors on the second half of the example log, µm, from ``judged`` of ``fit.json``."""
    arx = min((rms, name) for name, rms in judged["peers"].items() if name.startswith("ARX"))
    three = {"physics model": judged["rms_pb"], "hold": judged["rms_hold"], arx[1]: arx[0], "hybrid": judged["rms_h"]}
    sizes = [(rms, judged["largest"][name]) for name, rms in three.items()]
    named = zip(("physics", "hold", "arx", "hybrid"), sizes, strict=True)
    return {
        key + of: rounded(1e6 * one) for key, size in named for of, one in zip(("", ", largest"), size, strict=True)
    }


def published(folder: Path, chromium: str) -> Made:
    """Make the pictures of machines that others published; their figures are the commands' tables."""
    for name in ("xiao", "arms"):
        run(folder, "-m", f"benchmarks.outside.{name}", "--picture", f"{name}.png")
    return {f"{name}.png": folder / f"{name}.png" for name in ("xiao", "arms")}, {}


MAKERS: dict[tuple[str, ...], Callable[[Path, str], Made]] = {
    ("staircase.png", "staircase_compensated.png", "spiral_y.png", "spiral_contour.png"): demonstration,
    ("fit_report.png",): fitted,
    ("xiao.png", "arms.png"): published,
}


def hybridsep(folder: Path, *arguments: str) -> None:
    run(folder, "-c", "from hybridsep.app.cli import main; main()", *arguments)


def run(folder: Path, *arguments: str) -> None:
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), "COLUMNS": "100"}
    subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)


def rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


if __name__ == "__main__":
    main()
