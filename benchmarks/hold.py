"""Hold baseline of every command and FMU, recomputed by a few lines from the columns ``x_pb`` and ``x_meas``.

    python -m benchmarks.hold [--emps DATA_EMPS.mat] [--recordings FOLDER] [--Np 20]      (twenty minutes)

Each log is fitted; ``backtest --save`` writes the columns. From these alone the hold of each window is computed again
and compared with what ``backtest``, ``report`` and ``fit`` print, and with what the FMUs of both flavours show in
``rms_hold`` when the log is played to them, behind their own ``x_pb``. ``cosim`` is compared on the staircase; a report
in the digits that it prints.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import math
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest import mock

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # benchmarks are no part of the package

from hybridsep.app import cli
from hybridsep.cosim.adapters import FmuController

Column = list[float]

COLUMNS = ("x_pb", "x_meas", "active")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    parser.add_argument("--recordings", type=Path, help="folder with recorded logs, CSV or Siemens Capture")
    parser.add_argument("--Np", type=int, default=20)
    given = parser.parse_args(arguments)
    print("| log | compared | difference, m |\n|---|---|---|")
    worst = 0.0
    files = sorted(given.recordings.glob("*.[cj]s*")) if given.recordings is not None else []
    for log in ([given.emps] if given.emps is not None else []) + files:
        with tempfile.TemporaryDirectory() as folder:
            found = dict(of_log(log, Path(folder), given.Np))
        worst = max(worst, *found.values())
        for compared, difference in found.items():
            print(f"| {log.name} | {compared} | {difference:.1e} |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        difference = of_cosim(Path(folder))
    print(f"| staircase | cosim | {difference:.1e} |")
    return int(max(worst, difference) > 1e-12)


def hold(x_pb: Column, x_meas: Column, Np: int) -> Column:
    """Return the hold baseline, (n,), m: ``x_pb`` and the last residual measured before the window."""
    held, last = [], 0.0
    for k in range(0, len(x_pb), Np):
        held += [y + last for y in x_pb[k : k + Np]]
        last = ([x - y for x, y in zip(x_meas[k : k + Np], x_pb[k : k + Np], strict=True) if x == x] or [last])[-1]
    return held


def rms_of(x_meas: Column, predicted: Column) -> float:
    """Return the RMS error of the samples that were measured, m."""
    squares = [(x - y) ** 2 for x, y in zip(x_meas, predicted, strict=True) if x == x]
    return math.sqrt(math.fsum(squares) / len(squares))


def of_log(log: Path, folder: Path, Np: int) -> Iterator[tuple[str, float]]:
    """Yield what is compared on a log, and the difference, m."""
    fitted, written = folder / "axis", folder / "predictions.csv"
    fixed = ["--fix"] if "jitter" in log.name else []
    hybridsep("fit", log, *reading(log), *fixed, "--name", "axis", "--Np", Np, "--out", fitted)
    yield from of_replay(log, fitted / "machine.toml", folder, Np)
    x_d, x_pb, x_meas = (column(written, name) for name in ("x_d", "x_pb", "x_meas"))
    judged = json.loads((fitted / "fit.json").read_text(encoding="utf-8"))["judged"]["rms_hold"]
    again = hold(x_pb, x_meas, Np)
    first = -(-round(0.5 * len(x_pb)) // Np) * Np  # of the first window that begins in the second half
    yield "fit", abs(judged - rms_of(x_meas[first:], again[first:]))
    for archive in sorted(fitted.glob("*.fmu")):
        yield archive.name, of_fmu(archive, x_d, x_meas, Np)


def of_replay(log: Path, machine: str | Path, folder: Path, Np: int) -> Iterator[tuple[str, float]]:
    """Yield what backtest and report write and print of a log, and the difference, m; files stay in the folder."""
    written, batches, page = folder / "predictions.csv", folder / "batches.csv", folder / "report.html"
    fixed = "--fix" if "jitter" in log.name else "--as-is"
    command = (
        log,
        "-m",
        machine,
        *reading(log),
        fixed,
        "--Np",
        Np,
        "--p",
        min(Np, 50),
        "--trust",
        "true",
        "--t_init",
        0,
    )
    scores = json.loads(hybridsep("backtest", *command, "--save", written, "--out", batches, "--json"))
    x_pb, x_meas, x_hold = (column(written, name) for name in ("x_pb", "x_meas", "x_hold"))
    again = hold(x_pb, x_meas, Np)
    rms = rms_of(x_meas, again)
    yield "columns", max(abs(one - other) for one, other in zip(again, x_hold, strict=True))
    yield "backtest", abs(1e-6 * scores["rms_hold_um"] - rms)
    windows = [rms_of(x_meas[k : k + Np], again[k : k + Np]) for k in range(0, len(x_pb), Np)]
    printed = column(batches, "rms_hold")
    yield "windows", max(abs(one - other) for one, other in zip(printed, windows, strict=True))
    hybridsep("report", *command, "--out", page)
    text = page.read_text(encoding="utf-8")
    yield "report", 0.0 if any(f"<td>{scale * rms:.4g}</td>" in text for scale in (1e3, 1e6, 1e9)) else math.inf


def reading(log: Path) -> list[str]:
    """Return the options that a log is read with."""
    return ["--x_d", "qg", "--x", "qm"] if log.suffix == ".mat" else []


def of_fmu(archive: Path, x_d: Column, x_meas: Column, Np: int) -> float:
    """Return the difference of an FMU's ``rms_hold``, m, from the value that follows from the columns it shows."""
    controller, n = FmuController(archive, {"t_init": 0.0}, 0.0), len(x_d)
    with controller:
        controller.initialise(x_d[0])
        x_pb = []
        for k in range(n + Np):
            x_pb.append(controller.outputs()[0][1])
            controller.step(k, x_d[min(k, n - 1)], x_meas[max(k - Np, 0)])
        shown: float = controller.fmu.get("rms_hold")
    return float(abs(shown - rms_of(x_meas, hold(x_pb[Np:], x_meas, Np))))


def of_cosim(folder: Path) -> float:
    """Return the difference of the ``rms_hold`` that cosim prints over the staircase, m."""
    written = folder / "run.csv"
    scores = json.loads(hybridsep("cosim", "--out", written, "--json"))
    x_pb, x_meas, active = (column(written, name) for name in COLUMNS)
    again = hold(x_pb, x_meas, 100)
    published = [y if on else pb for y, pb, on in zip(again, x_pb, active, strict=True)]  # x_pb in the warm-up
    return float(abs(1e-6 * scores["rms_hold_um"] - rms_of(x_meas, published)))


def column(path: Path, name: str) -> Column:
    """Return a column of a CSV."""
    with path.open(newline="", encoding="utf-8") as file:
        return [float(row[name]) for row in csv.DictReader(file)]


def hybridsep(*arguments: object) -> str:
    """Run ``hybridsep`` in this process and return what it prints."""
    printed, told = io.StringIO(), io.StringIO()
    with mock.patch("sys.argv", ["hybridsep", *map(str, arguments)]):
        try:
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(told):
                cli.main()
        except SystemExit as stop:
            if stop.code:
                raise RuntimeError(f"hybridsep {' '.join(map(str, arguments))}: {told.getvalue()}") from None
    return printed.getvalue()


if __name__ == "__main__":
    sys.exit(main())
