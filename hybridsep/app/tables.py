"""Output of the command line: tables, or JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.table import Table

from ..base.metrics import shown_figure
from ..demo.page import Table as CaseTable
from ..demo.page import compensation_table, prediction_table
from ..logs.units import Shown, shown_in

if TYPE_CHECKING:
    from ..cosim.run import Run
    from ..evaluate.verdict import Verdict

__all__ = [
    "console",
    "print_compensation",
    "print_json",
    "print_predictions",
    "print_run",
    "print_scores",
    "print_without_first",
    "print_written",
]


class _WholeLines(Console):
    """Console that breaks no line of text where it is no terminal: what reads it may look for one."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does."""
        if not self.is_terminal and all(isinstance(one, str) for one in objects):
            options.setdefault("soft_wrap", True)
        super().print(*objects, **options)


console = _WholeLines(emoji=False, markup=False, highlight=False)
"""Standard output. Units and names of files may have brackets, which are text there, as in the tables."""


def print_predictions(summary: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the prediction errors of the demo."""
    _print_table(prediction_table(summary))
    if "spiral_x" in summary:
        console.print(
            "The stage has the paper's Table 1 and a simulated disturbance, scaled to the printed physics figures: "
            "these agree by construction, the hybrid's do not."
        )
    for name, case in summary.items():
        n, worse = case["n_batches"], case["batches_hybrid_worse"]
        text = f"{name}: of {n} windows the hybrid is worse than physics in {len(worse)}"
        times = ", ".join(f"{batch['t_s']:g}" for batch in worse)
        console.print(
            f"{text}{f' (from {times} s on)' if worse else ''}, worse than hold in {case['n_batches_worse_than_hold']}"
        )
        console.print(case["verdict"])


def print_compensation(summary: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the tracking errors of the demo's compensated runs."""
    _print_table(compensation_table(summary))


def _print_table(content: CaseTable) -> None:
    """Print a table of the demo's cases; it fits 80 columns."""
    table = Table(
        "case",
        title=f"\n{content.title}",
        caption=content.note,
        box=box.SIMPLE,
        pad_edge=False,
        collapse_padding=True,
        show_edge=False,
    )
    table.columns[0].no_wrap = True
    for column in content.columns:
        table.add_column(column, justify="right", no_wrap=True)
    for row in content.rows:
        table.add_row(*row)
    console.print(table)


PREDICTIONS = {"pb": "physics", "hold": "hold", "arx20": "ARX20", "arx40": "ARX40", "h": "hybrid"}
"""Names in summaries, and what they are called; ARX models are of replays of logs only."""


def print_scores(
    summary: Mapping[str, Any],
    verdict: Verdict,
    as_json: bool,
    title: str,
    *,
    unit: str = "m",
    shown: Shown | None = None,
    more: Mapping[str, Any] | None = None,
) -> None:
    """Print prediction errors, of a run or of a backtest, and what they mean.

    Parameters
    ----------
    summary : mapping
        Scores, in millionths of the axis's unit.
    verdict : Verdict
    as_json : bool
        Print them as JSON, with ``more``; the names of a rotary axis's end in ``_urad``.
    title : str
    unit : {"m", "rad"}
        Unit of the axis's positions.
    shown : Shown, optional
        Units of the table; ``unit``'s if left out.
    more : mapping, optional
    """
    if as_json:
        print_json(
            {
                **{name.replace("_um", f"_u{unit}"): value for name, value in summary.items()},
                "verdict": str(verdict),
                **(more or {}),
            }
        )
        return
    factor, name = (shown or shown_in(unit)).error(1e-6 * float(summary["rms_pb_um"]))
    keys = [key for key in PREDICTIONS if f"rms_{key}_um" in summary]
    table = Table(
        title=f"{title}: prediction error in {name} against the measured position",
        box=box.SIMPLE,
        pad_edge=False,
        collapse_padding=True,
    )
    for column in ("", *(PREDICTIONS[key] for key in keys), "reduction", "× hold"):
        table.add_column(column, justify="right", no_wrap=True)
    warmed_up = summary.get("n_samples_after_warm_up") != summary["n_samples"]
    parts = (("", ""), ("_after_warm_up", " after warm-up"))
    for suffix, label in parts if warmed_up else parts[:1]:
        for quantity in ("rms", "max"):
            if f"{quantity}_pb_um{suffix}" in summary:
                figures = [summary[f"{quantity}_{key}_um{suffix}"] for key in keys]
                compared = [summary[f"{key}{suffix}"] for key in ("reduction_percent", "ratio_to_hold")]
                ratios = [shown_figure(compared[0], " %"), shown_figure(compared[1])] if quantity == "rms" else ["", ""]
                label_text = f"{quantity.upper() if quantity == 'rms' else quantity}{label}"
                shown_sizes = [one if isinstance(one, str) else shown_figure(1e-6 * factor * one) for one in figures]
                table.add_row(label_text, *shown_sizes, *ratios)
    console.print(table)
    console.print(str(verdict))


def print_without_first(rms: Mapping[str, float], shown: Shown) -> None:
    """Print RMS errors, m or rad, without the first window of a log in motion, by their names in summaries."""
    factor, name = shown.error(rms["pb"])
    figures = ", ".join(f"{peer} {shown_figure(factor * rms[key])}" for key, peer in PREDICTIONS.items() if key in rms)
    console.print(f"Without the first window, of whose start in motion no model knows the state: RMS {figures} {name}.")


def print_run(run: Run, as_json: bool, title: str, limits: Mapping[str, float] | None = None) -> None:
    """Print the figures of a run: its prediction errors, or its tracking errors and the ``limits`` that bind them."""
    from ..cosim.run import PREDICTOR
    from ..evaluate.verdict import verdict_of

    if run.kind == PREDICTOR:
        print_scores(run.summary(), verdict_of(run), as_json, title)
    else:
        _print_tracking(run.summary(), as_json, title, limits)


def _print_tracking(
    summary: Mapping[str, float | int], as_json: bool, title: str, limits: Mapping[str, float] | None
) -> None:
    """Print tracking errors, change of the command and its peaks."""
    from ..fitting.compensation import binding_words

    if as_json:
        print_json({**summary, **({} if limits is None else {"limits_that_bind": limits})})
        return
    table = Table(title=title)
    for column in ("", "RMS [µm]", "max [µm]"):
        table.add_column(column, justify="right" if column else "left")
    for name, label in (
        ("tracking", "tracking error, true position"),
        ("tracking_measured", "tracking error, measured position"),
        ("change", "change of the command"),
    ):
        table.add_row(label, *(shown_figure(summary[f"{name}_{quantity}_um"]) for quantity in ("rms", "max")))
    console.print(table)
    peaks = [summary[f"peak_{name}"] for name in ("velocity_m_s", "acceleration_m_s2", "jerk_m_s3")]
    console.print(
        f"command to the drive: at most {1e3 * peaks[0]:.1f} mm/s, {peaks[1]:.2f} m/s², {peaks[2]:.0f} m/s³\n"
        f"planned by the hybrid {summary['share_hybrid']:.1%}, by the physics model {summary['share_physics']:.1%}, "
        f"not compensated {summary['share_off']:.1%} of the samples"
    )
    if limits is not None:
        console.print(binding_words(limits))


def print_written(*paths: Path | None) -> None:
    """Print the names of files that were written, None being none."""
    for path in paths:
        if path is not None:
            console.print(f"wrote {path}", soft_wrap=True)


def print_json(result: Any) -> None:
    """Print JSON; figures that are not finite, such as scores over no sample, are null."""
    typer.echo(json.dumps(_finite(result), indent=2))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
