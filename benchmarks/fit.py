"""``hybridsep fit`` over logs of several machines, judged on their second halves, beside what needs no learning.

    python benchmarks/fit.py [--emps DATA_EMPS.mat] [--recordings FOLDER]      (ten minutes)

RMS of the second half, which taught nothing, in 1e-6 of the log's unit: a first-order lag with dead time, fitted to the
first half by least squares; hold of its last residual over the window; the identified physics model; the hybrid that
the first half taught. The ratio is to the better of lag and hold. ``time`` is in multiples of one replay with the
settings that were chosen.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # benchmarks are no part of the package

from benchmarks.trust import fitted_model
from hybridsep.app.arguments import machine_name
from hybridsep.app.fit import FitOptions, fit
from hybridsep.app.log_intake import take_in
from hybridsep.base.errors import HybridSepError
from hybridsep.base.settings import PredictorSettings
from hybridsep.logs.log import Log, read_log
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.tune.choice import settings_for
from hybridsep.tune.halves import halves, replay

WINDOWS = (100, 20)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    parser.add_argument("--recordings", type=Path, help="folder with recorded logs, CSV or Siemens Capture")
    given = parser.parse_args(arguments)
    print("| log | Np | lag | hold | physics | hybrid | ratio | 95 % holds | p, q | time |\n|---|" + "---|" * 9)
    for log in logs(given.emps, given.recordings):
        for Np in WINDOWS:
            print(row(log, Np), flush=True)


def logs(emps: Path | None, recordings: Path | None) -> Iterator[Log]:
    """Yield the logs, as their files are."""
    if emps is not None:
        yield read_log(emps, columns={"x_d": "qg", "x": "qm"}, uniform=False)
    files = sorted(recordings.glob("*")) if recordings is not None else []
    for path in files:
        if path.suffix in (".csv", ".json"):
            yield read_log(path, uniform=False)


def row(log: Log, Np: int) -> str:
    """Return a row of the table."""
    name = f"| {log.path.name} | {Np} |"
    try:
        used, _ = take_in([log], fix=False)
        lag, hold = peers(used[0], Np)
        with tempfile.TemporaryDirectory() as folder:
            begin = perf_counter()
            found = fit(used, Path(folder), FitOptions(Np, machine_name(log.path)))
            taken = perf_counter() - begin
    except HybridSepError as error:
        return f"{name} {error} |"
    settings = found.machine.predictor_settings
    begin = perf_counter()
    replay(HybridPredictor(found.machine.model, settings), found.judged.recordings)
    once = perf_counter() - begin
    pb, _, h = found.judged.rms()
    ratio = h / min(lag, hold) if min(lag, hold) > 0.0 else 1.0
    errors, std = found.judged.errors()[2], found.judged.joined("x_h_std")
    within = float((abs(errors) <= 1.96 * std).mean())
    figures = " | ".join(f"{1e6 * value:.4g}" for value in (lag, hold, pb, h))
    return f"{name} {figures} | {ratio:.3f} | {within:.2f} | {settings.p}, {settings.q} | {taken / once:.0f} |"


def peers(log: Log, Np: int) -> tuple[float, float]:
    """Return the RMS errors, m, of a lag with dead time and of hold on it, over the second half."""
    [recording] = halves([(log.x_d, log.x_meas)], 0.5)
    model = fitted_model(*recording.taught, log.T_s)
    settings: PredictorSettings = settings_for(Np, log.T_s, "zoh")
    lag, hold, _ = replay(HybridPredictor(model, settings), [recording]).rms()
    return lag, hold


if __name__ == "__main__":
    main()
