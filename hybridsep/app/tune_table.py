"""Output of ``hybridsep tune``: ranked candidates, the choice, the error over other windows; or plain values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from ..base.metrics import reduction_percent, shown_figure
from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..fitting.choice import WORTH
from ..fitting.tuning import TUNED, Tuning, joint_ratio
from ..logs.units import DisplayUnits
from .console import console

__all__ = ["entries", "print_tuning", "tuning_summary"]

_ROWS = 10
"""Candidates that are printed, besides the machine's own settings."""

_LOGS = 4
"""Logs whose RMS errors have a column each."""

_MARGIN = f"{100 * WORTH:.0f} %"

Values = Mapping[str, Sequence[Any]]


def entries(settings: PredictorSettings, values: Values) -> dict[str, Any]:
    """Return the tuned entries of ``[predictor]`` by their names in the machine file."""
    return {TUNED[field].name: getattr(settings, field) for field in values}


def tuning_summary(tuning: Tuning, windows: Mapping[int, Tuning], values: Values) -> dict[str, Any]:
    """Return a tuning as plain values, errors in m (or rad)."""
    chosen = tuning.candidates[tuning.chosen]
    return {
        "Np": chosen.Np,
        "averaging": chosen.averaging,
        "logs": {
            name: {"rms_pb": float(tuning.rms_pb[i]), "rms_hold": float(tuning.rms_hold[i])}
            for i, name in enumerate(tuning.logs)
        },
        "chosen": entries(chosen, values),
        "ratio_to_hold": float(tuning.ratio[tuning.chosen]),
        "n_diverged": tuning.n_diverged,
        "n_alike": len(tuning.alike),
        "candidates": [
            {
                **entries(tuning.candidates[i], values),
                "rms_h": dict(zip(tuning.logs, tuning.rms_h[i].tolist(), strict=True)),
                "ratio_to_hold": float(tuning.ratio[i]),
                "own": i == 0,
            }
            for i in tuning.ranking
        ],
        "over_Np": [
            {
                "Np": Np,
                **{
                    name: {"rms_pb": pb, "rms_hold": hold, "rms_h": h}
                    for name, pb, hold, h in zip(
                        found.logs, found.rms_pb.tolist(), found.rms_hold.tolist(), found.rms_h[0].tolist(), strict=True
                    )
                },
            }
            for Np, found in windows.items()
        ],
    }


def print_tuning(
    tuning: Tuning, windows: Mapping[int, Tuning], values: Values, title: str, shown: DisplayUnits
) -> None:
    """Print a tuning in the units of its logs."""
    chosen = tuning.candidates[tuning.chosen]
    factor, unit = shown.error(float(np.max(tuning.rms_pb)))
    heading = f"{title}: RMS in {unit} against the measured position, Np = {chosen.Np}"
    console.print(heading)
    console.print(_ranked(tuning, values, factor))
    for line in _words(tuning, values):
        console.print(line)
    console.print(
        f"\nThe same settings over other look-aheads, RMS in {unit}; no choice: the look-ahead is the controller's, "
        "and a shorter one is always predicted better"
    )
    console.print(_over_windows(windows, factor))
    console.print("For the machine file:\n")
    lines = {"Np": chosen.Np, **entries(chosen, values), "averaging": str(chosen.averaging).lower()}
    console.print("[predictor]")
    for name, value in lines.items():
        console.print(f"{name} = {value}")


def _ranked(tuning: Tuning, values: Values, factor: float) -> Table:
    """Return the table of the best candidates and of the machine's own, below the baselines."""
    table = Table("", box=box.SIMPLE, pad_edge=False)
    for field in values:
        table.add_column("λ" if field == "lam" else field, justify="right")
    names = tuning.logs if len(tuning.logs) <= _LOGS else ()
    for name in names:
        table.add_column(name, justify="right", max_width=16)
    table.add_column("reduction", justify="right")
    table.add_column("× hold", justify="right")

    def row(label: str, cells: Sequence[str], rms: Array, ratio: float) -> None:
        errors = [shown_figure(factor * value) for value in rms.tolist()] if names else []
        reduction = reduction_percent(joint_ratio(rms, tuning.rms_hold), tuning.ratio_pb)
        last = ["diverges", ""] if math.isinf(ratio) else [shown_figure(reduction, " %"), f"{ratio:.3f}"]
        table.add_row(label, *cells, *errors, *last)

    empty = [""] * len(values)
    row("physics", empty, tuning.rms_pb, tuning.ratio_pb)
    row("hold", empty, tuning.rms_hold, 1.0)
    shown = tuning.ranking[:_ROWS]
    for i in shown if 0 in shown else [*shown, 0]:
        rank = tuning.ranking.index(i) + 1
        cells = [f"{getattr(tuning.candidates[i], field):g}" for field in values]
        row(f"{rank}{', as it is' if i == 0 else ''}", cells, tuning.rms_h[i], float(tuning.ratio[i]))
    return table


def _words(tuning: Tuning, values: Values) -> list[str]:
    """Return how the candidates were ranked, how many are alike, and what was chosen."""
    n, best = len(tuning.candidates), tuning.candidates[tuning.ranking[0]]
    if tuning.n_diverged == n:
        return [f"all {n} candidates diverge; try larger --lambda or smaller --p"]
    lines = []
    if len(tuning.logs) > 1:
        lines.append("ranked by the geometric mean over the logs of RMS relative to hold; reduction is from physics")
    spans = []
    for field in values:
        alike = [getattr(tuning.candidates[i], field) for i in tuning.alike]
        span = f"{min(alike):g}" if min(alike) == max(alike) else f"{min(alike):g} … {max(alike):g}"
        spans.append(f"{TUNED[field].name} {span}")
    lines.append(f"{len(tuning.alike)} of {n} candidates are within {_MARGIN} of the best: {', '.join(spans)}")
    if tuning.n_diverged:
        lines.append(f"{tuning.n_diverged} of {n} diverge")
    described = ", ".join(f"{name} = {value:g}" for name, value in entries(best, values).items())
    gain = reduction_percent(float(tuning.ratio[tuning.ranking[0]]), float(tuning.ratio[0]))
    if tuning.chosen:
        lines.append(f"chosen: {described}, {gain:.1f} % better than the machine's own settings")
    else:
        lines.append(
            f"chosen: the machine's own settings; the best is {gain:.1f} % better, less than {_MARGIN} may be chance"
        )
    if min(tuning.ratio) >= 1.0:
        lines.append("no candidate is better than holding the last residual")
    return lines


def _over_windows(windows: Mapping[int, Tuning], factor: float) -> Table:
    """Return the table of errors with shorter and longer windows."""
    table = Table(
        *("Np", "log", "physics", "hold", "hybrid", "× hold"),
        box=box.SIMPLE,
        pad_edge=False,
    )
    for column in table.columns:
        column.justify = "left" if column.header == "log" else "right"
    for Np, found in windows.items():
        for i, name in enumerate(found.logs):
            hold, h = float(found.rms_hold[i]), float(found.rms_h[0, i])
            figures = [shown_figure(factor * value) for value in (float(found.rms_pb[i]), hold, h)]
            ratio = joint_ratio(found.rms_h[0, i : i + 1], found.rms_hold[i : i + 1])
            table.add_row("" if i else str(Np), name, *figures, "diverges" if math.isinf(h) else f"{ratio:.3f}")
    return table
