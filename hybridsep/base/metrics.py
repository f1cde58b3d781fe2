"""Figures of merit of sampled signals, and how results show theirs: in one line, in a table, in a plot."""

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .signals import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ErrorSize:
    """RMS and largest magnitude of the samples of an error that are known, m or rad; NaN if there are none."""

    rms: float
    largest: float

    @classmethod
    def of(cls, error: Array) -> "ErrorSize":
        """Return the size of ``(n,)`` samples, NaN where they are not known."""
        known = error[~np.isnan(error)]
        return cls(rms(known), largest(known)) if known.size else cls(math.nan, math.nan)


@dataclass(frozen=True)
class Score:
    """Errors of physics model, hold baseline and hybrid against the measured position, over ``n_samples`` samples."""

    n_samples: int
    pb: ErrorSize
    hold: ErrorSize
    h: ErrorSize

    @classmethod
    def of(cls, errors: Array) -> "Score":
        """Return the score of the errors of the three, ``(3, n)``, m, NaN where missing."""
        return cls(int((~np.isnan(errors[0])).sum()), *map(ErrorSize.of, errors))

    def figures(self, suffix: str = "") -> dict[str, float | int]:
        """Return ``rms_pb_um``, ``max_h_um``, ``reduction_percent``, ``ratio_to_hold`` and the like, errors in µm."""
        sizes = {"pb": self.pb, "hold": self.hold, "h": self.h}
        found = {
            **{f"rms_{name}_um": 1e6 * one.rms for name, one in sizes.items()},
            **{f"max_{name}_um": 1e6 * one.largest for name, one in sizes.items()},
            "reduction_percent": reduction_percent(self.h.rms, self.pb.rms),
            "ratio_to_hold": rms_ratio(self.h.rms, self.hold.rms),
            "n_samples": self.n_samples,
        }
        return {name + suffix: figure for name, figure in found.items()}


def rms(error: ArrayLike) -> float:
    """Return the root mean square of samples of any shape."""
    return float(np.sqrt(np.mean(np.square(error))))


def known_rms(error: Array) -> float:
    """Return the RMS of the samples that are known, not NaN; NaN if there are none."""
    return ErrorSize.of(error).rms


def largest(error: ArrayLike) -> float:
    """Return the largest magnitude of samples of any shape; 0 if there are none."""
    return float(np.max(np.abs(error), initial=0.0))


def coverage(error: Array, std: Array, level: float) -> float:
    """Return the share of errors, 0 … 1, within the interval of a level, 0 … 1, around 0 of a normal distribution.

    ``error``, ``(n,)``, m, is NaN where there is none; ``std`` are its standard deviations.
    """
    known = ~np.isnan(error)
    return float(np.mean(np.abs(error[known]) <= NormalDist().inv_cdf(0.5 + 0.5 * level) * std[known]))


def reduction_percent(rms_h: float, rms_pb: float) -> float:
    """Return the reduction of the RMS error from the physics model to the hybrid, %."""
    return 100.0 * (1.0 - rms_ratio(rms_h, rms_pb))


def rms_ratio(rms_h: float, rms_peer: float, least: float = 0.0) -> float:
    """Return the RMS error of the hybrid relative to a peer's: 1 if both are 0, NaN if the peer's is < ``least``."""
    if rms_peer < least:
        return math.nan
    if rms_peer == 0.0:
        return 1.0 if rms_h == 0.0 else math.inf
    return rms_h / rms_peer


def hold(x_pb: Array, x_meas: Array, active: NDArray[np.bool_], Np: int, *, late: int = 0) -> Array:
    """Return the hold baseline: ``x_pb`` plus the last residual measured before each window; ``x_pb`` in the warm-up.

    It follows from what was published and measured, ``(n,)`` each, m, NaN where missing, no model or guard has a part
    in it. The warm-up is over where samples are ``active``; measurements were ``late`` samples late.
    """
    samples = np.arange(len(x_meas))
    measured = np.maximum.accumulate(np.where(np.isnan(x_meas), -1, samples))
    begin = samples // Np * Np - late  # what is measured from here on has not arrived yet
    last = np.where(begin > 0, measured[begin - 1], -1)
    return np.where(active & (last >= 0), x_pb + (x_meas - x_pb)[last], x_pb)


def batch_rms(error: Array, Np: int) -> Array:
    """Return the RMS per batch, ``(n_batches,)``, of an error ``(n,)``; the last may be shorter.

    Samples that are NaN, not measured, do not count; a batch of nothing else is NaN.
    """
    starts = np.arange(0, len(error), Np)
    known = ~np.isnan(error)
    counts = np.add.reduceat(known.astype(np.float64), starts)
    squares = np.add.reduceat(np.where(known, error, 0.0) ** 2, starts)
    return np.where(counts > 0, np.sqrt(squares / np.maximum(counts, 1.0)), np.nan)


def peak_derivatives(x: Array, T_s: float) -> tuple[float, float, float]:
    """Return the peak velocity, acceleration and jerk, m/s, m/s², m/s³, by differences of positions ``(n,)``, m."""
    velocity, acceleration, jerk = (largest(np.diff(x, order)) / T_s**order for order in (1, 2, 3))
    return velocity, acceleration, jerk


def shown_figure(value: float | None, unit: str = "") -> str:
    """Return a figure as text, a dash where there is none."""
    if value is None or not np.isfinite(value):
        return "–"
    return f"{value:.1f}{unit}" if unit else f"{value:.2f}"


def one_line(name: str, figures: Mapping[str, Any]) -> str:
    """Return ``Name(a = 1, b = 2.5)``."""
    return f"{name}({', '.join(f'{key} = {_shown(value)}' for key, value in figures.items())})"


def html_table(title: str, figures: Mapping[str, Any]) -> str:
    """Return a table for a notebook."""
    rows = "".join(f"<tr><td>{escape(key)}</td><td>{_shown(value)}</td></tr>" for key, value in figures.items())
    return f"<table><caption>{escape(title)}</caption>{rows}</table>"


def line_plot(x: Array, lines: Mapping[str, Array], x_label: str, y_label: str) -> "Figure":
    """Return a figure of lines over ``x``, which a notebook shows without pyplot or a magic command."""
    from matplotlib.figure import Figure

    class ShownFigure(Figure):
        def _repr_png_(self) -> bytes:
            self.savefig(file := io.BytesIO(), format="png")
            return file.getvalue()

    figure = ShownFigure(figsize=(8.0, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, y in lines.items():
        axes.plot(x, y, label=name, linewidth=1.0)
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def in_unit(figures: Mapping[str, Any], unit: str) -> dict[str, Any]:
    """Return figures by names of the SI unit of the positions: those in µm are in µrad of a rotary axis."""
    return {name.replace("_um", f"_u{unit}").replace("_m_s", f"_{unit}_s"): one for name, one in figures.items()}


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


class Move(NamedTuple):
    """Move of a log, from its first sample to the next move's."""

    start: float  # s, from the beginning of the piece
    largest: float  # largest servo error, m
    settling: float  # s from the end of the command until the error stays within the window; inf where it never does


def moves_of(x_d: Array, x: Array, T_s: float, in_position: float) -> list[Move]:
    """Return the moves of a command and its measured positions, ``(n,)``, m, NaN where missing."""
    changes = np.flatnonzero(np.diff(x_d) != 0.0)
    if not len(changes):
        return []
    ends = np.append(np.flatnonzero(np.diff(changes) > 10), len(changes) - 1)  # as many samples of rest end a move
    firsts, lasts = changes[np.append(0, ends[:-1] + 1)], changes[ends] + 1
    error, found = np.abs(x_d - x), []
    for first, last, until in zip(firsts, lasts, np.append(firsts[1:], len(x_d)), strict=True):
        outside = np.flatnonzero(error[last:until] > in_position)
        late = 0.0 if not len(outside) else T_s * (outside[-1] + 1.0) if outside[-1] + 1 < until - last else math.inf
        found.append(Move(T_s * float(first), float(np.nanmax(error[first:until], initial=0.0)), late))
    return found
