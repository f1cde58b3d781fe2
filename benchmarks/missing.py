"""Predictions where measurements are missing, relative to those where none is: hybrid model and ARX models.

    python -m benchmarks.missing --emps DATA_EMPS.mat      (five minutes)

Of six recordings every n-th sample is missing, or some at random. The hybrid is replayed by the C core; ARX models are
refitted before each window. RMS of the test half against all its measurements, those that were taken away, too.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.ablation.axes import Axis, logs_of
from benchmarks.ablation.core import CoreVariant
from hybridsep.base.metrics import rms
from hybridsep.base.signals import Indices
from hybridsep.evaluate.peers import REFITTED, Piece, predict_peers

EVERY, SHARES = (30, 20, 15, 10, 7, 5, 4, 3), (0.05, 0.1, 0.2, 0.3, 0.36, 0.4)
"""Samples from one missing measurement to the next; shares of those missing at random."""

LOGS = (
    "DATA_EMPS, Np = 100",
    "cnc_a_axis2, Np = 20",
    "cnc_b_axis2, Np = 100",
    "xl330_kp400, Np = 20",
    "xl330_sin_sin_kp100, Np = 100",
    "so101_multisine_elbow, Np = 20",
)
"""Recordings and windows."""


def cases(n: int) -> Mapping[str, Indices]:
    """Return the missing samples of ``n`` by the name of the case."""
    found = {"none": np.empty(0, dtype=np.intp)}
    found |= {f"every {i}th": np.arange(i - 1, n, i) for i in EVERY}
    drawn = np.random.default_rng(0).random(n)
    return found | {f"{100 * share:g} % at random": np.flatnonzero(drawn < share) for share in SHARES}


def errors_of(axis: Axis) -> dict[str, list[float]]:
    """Return the RMS errors of hybrid, ARX20 and ARX40 over the test half, m, by the name of the case."""
    core, n, first, found = CoreVariant({}), len(axis.x_d), axis.first, {}
    for name, missing in cases(n).items():
        x = axis.x[0].copy()
        x[missing] = np.nan
        (x_h, _), _ = core.replay(axis.model, axis.settings, (axis.x_d, x), (np.empty(0), np.empty(0)))
        peers = predict_peers([Piece(axis.x_d, x, n // 2, first)], axis.settings.Np)
        predictions = [x_h, *(peer.predictions[0] for peer in peers if peer.way == REFITTED)]
        found[name] = [rms((axis.x[0] - one)[first:]) for one in predictions]
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    axes = [make() for make in logs_of(parser.parse_args(arguments).emps)]
    for axis in (one for one in axes if one.name in LOGS):
        print(axis.name)
        found = errors_of(axis)
        for name, errors in found.items():
            ratios = (f"{error / least:10.3f}" for error, least in zip(errors, found["none"], strict=True))
            print(f"  {name:20}{''.join(f'{1e6 * error:12.4g}' for error in errors)}{''.join(ratios)}", flush=True)


if __name__ == "__main__":
    main()
