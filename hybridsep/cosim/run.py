"""Record of a run of a controller and a drive over a trajectory: signals, figures, file."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import metrics
from ..base.files import as_path, atomic_open, write_whole
from ..base.signals import Array
from ..online.look_ahead import SepState

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ControllerType:
    """Kind of a controller: its outputs in the loop and the columns of its runs' files."""

    name: str  # name in error messages
    outputs: tuple[str, ...]  # its positions, m; the first one goes to the drive
    state: str  # its Integer or Boolean output that says which model predicts
    state_offset: SepState  # state that stands for 0 of that output
    delay: str  # its parameter with the number of samples by which it delays the trajectory
    columns: tuple[str, ...]  # attributes of :class:`Run` that are saved


PREDICTOR = ControllerType(
    "predictor",
    ("x_d", "x_pb", "x_h", "x_h_std"),
    state="hybrid_active",
    state_offset=SepState.PHYSICS,
    delay="Np",
    columns=("t", "x_d", "x", "x_meas", "x_pb", "x_hold", "x_h", "x_h_std", "active"),
)
"""The loop is open: the drive gets the commanded position."""

COMPENSATOR = ControllerType(
    "compensator",
    ("x_dm", "x_d", "x_pb", "x_h", "x_h_std"),
    state="sep_state",
    state_offset=SepState.OFF,
    delay="preview",
    columns=("t", "x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "x_h_std", "state"),
)
"""The loop is closed: the drive gets the modified command."""


@dataclass(frozen=True, repr=False, eq=False)
class Run:
    """Signals of a run, without the first fill of the look-ahead.

    It prints as one line, and as a table in a notebook; :meth:`plot` draws its errors over time.

    Attributes
    ----------
    kind : ControllerType
        :data:`PREDICTOR` or :data:`COMPENSATOR`.
    t : (n,) array, s
        Communication points.
    x_d, x_dm : (n,) array, m
        Commanded position and the modified command; the same where the loop is open.
    x, x_meas : (n,) array, m
        True and measured position; the true one of a recorded axis is NaN.
    x_pb, x_h : (n,) array, m
        Physics-based prediction under ``x_dm``, and the one by the model in ``state``.
    x_h_std : (n,) array, m
        Standard deviation of ``x_meas − x_h``; 0 where it is not known.
    state : (n,) array of int
        :class:`~hybridsep.online.look_ahead.SepState` of each sample: the model that predicts, or that planned.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples in a window.
    n_rejected : int
        Measurements that were missing or not plausible, as far as the controller tells.
    measurement_delay : int
        Samples by which measurements arrived late at the controller; −1: a sample early, and it held them.
    unit : {"m", "rad"}
        Unit of the positions, of a log that says so; figures that are called ``_um``, in µm, are ``_urad`` then.
    """

    kind: ControllerType
    t: Array
    x_d: Array
    x_dm: Array
    x: Array
    x_meas: Array
    x_pb: Array
    x_h: Array
    x_h_std: Array
    state: NDArray[np.int64]
    T_s: float
    Np: int
    n_rejected: int = 0
    measurement_delay: int = 0
    unit: str = "m"

    def __repr__(self) -> str:
        return metrics.one_line("Run", self._figures())

    def _repr_html_(self) -> str:
        return metrics.html_table(f"Run of a {self.kind.name}", self._figures())

    def plot(self) -> "Figure":
        """Return a matplotlib figure over time, µm: errors of the predictions, or the tracking error and the change."""
        if self.kind == PREDICTOR:
            lines = {"physics model": self.x_meas - self.x_pb, "hybrid": self.x_meas - self.x_h}
        else:
            lines = {"tracking error": self.error, "change of the command": self.change}
        return metrics.line_plot(self.t, {name: 1e6 * line for name, line in lines.items()}, "t [s]", f"[µ{self.unit}]")

    def _figures(self) -> dict[str, float | int]:
        summary = self.summary()
        names = ("rms_pb", "rms_hold", "rms_h", "tracking_rms", "tracking_max", "change_max")
        shown = ("n_samples", *(f"{name}_u{self.unit}" for name in names))
        return {name: summary[name] for name in shown if name in summary}

    @property
    def active(self) -> NDArray[np.bool_]:
        """Whether the hybrid model predicts, ``(n,)``."""
        return np.asarray(self.state == SepState.HYBRID)

    @property
    def x_hold(self) -> Array:
        """Hold baseline, ``(n,)``, m."""
        return metrics.hold(self.x_pb, self.x_meas, self.active, self.Np, late=max(0, self.measurement_delay))

    @property
    def change(self) -> Array:
        """Change of the command, ``x_dm − x_d``, ``(n,)``, m."""
        return np.asarray(self.x_dm - self.x_d, dtype=np.float64)

    @property
    def error(self) -> Array:
        """Tracking error ``x_d − x`` of the true position, ``(n,)``, m."""
        return np.asarray(self.x_d - self.x, dtype=np.float64)

    @property
    def tracking_rms(self) -> float:
        """RMS of the tracking error of the true position, m."""
        return metrics.rms(self.error)

    def summary(self) -> dict[str, float | int]:
        """Return the figures of the run's kind: prediction errors, or tracking errors."""
        return self.prediction_figures() if self.kind == PREDICTOR else self.tracking_figures()

    def prediction_figures(self) -> dict[str, float | int]:
        """Return RMS and largest errors, µm, over the whole trajectory, of the measured position unless named true."""
        figures = {
            **metrics.Score.of(self.x_meas - np.stack((self.x_pb, self.x_hold, self.x_h))).figures(),
            "rms_pb_true_um": 1e6 * metrics.rms(self.x - self.x_pb),
            "rms_h_true_um": 1e6 * metrics.rms(self.x - self.x_h),
            "servo_error_rms_um": 1e6 * metrics.rms(self.error),
            "n_samples": len(self.t),
        }
        return metrics.in_unit(figures, self.unit)

    def tracking_figures(self) -> dict[str, float | int]:
        """Return tracking errors, change of the command and shares of the models over the whole trajectory.

        These are RMS and largest magnitude in µm of the tracking error, against the true position and (``_measured_``)
        the measured one, and of the command's change; the largest velocity, acceleration and jerk of ``x_dm``, of its
        differences; the share of the samples that each model planned, 0 … 1.
        """
        figures: dict[str, float | int] = {}
        signals = {"tracking": self.error, "tracking_measured": self.x_d - self.x_meas, "change": self.change}
        for name, signal in signals.items():
            figures[f"{name}_rms_um"] = 1e6 * metrics.rms(signal)
            figures[f"{name}_max_um"] = 1e6 * metrics.largest(signal)
        names = ("peak_velocity_m_s", "peak_acceleration_m_s2", "peak_jerk_m_s3")
        figures |= dict(zip(names, metrics.peak_derivatives(self.x_dm, self.T_s), strict=True))
        figures |= {f"share_{one.name.lower()}": float(np.mean(self.state == one)) for one in SepState}
        return metrics.in_unit({**figures, "n_samples": len(self.t)}, self.unit)

    def batch_rms(self) -> dict[str, Array]:
        """Return the RMS errors of each window, m, ``(n_batches,)``, of ``x_pb``, ``x_hold`` and ``x_h``."""
        return {one: metrics.batch_rms(self.x_meas - getattr(self, one), self.Np) for one in ("x_pb", "x_hold", "x_h")}

    def save(self, path: str | Path) -> None:
        """Write the columns of the run's kind, ``.csv`` or ``.npz``, as :func:`save_columns` does."""
        save_columns({name: getattr(self, name) for name in self.kind.columns}, path)


def save_columns(columns: Mapping[str, Any], path: str | Path) -> None:
    """Write arrays ``(n,)`` by name, truth values as 0 and 1: ``.csv`` or ``.npz``, ValueError for another suffix."""
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        with atomic_open(path) as archive:
            np.savez_compressed(archive, **columns)
    elif suffix == ".csv":
        texts = [
            map(repr, (column.astype(np.int64) if column.dtype == np.bool_ else column).tolist())
            for column in columns.values()
        ]
        table = io.StringIO()
        writer = csv.writer(table)
        writer.writerow(columns)
        writer.writerows(zip(*texts, strict=True))
        write_whole(path, table.getvalue())
    else:
        raise ValueError(f"results are written as .csv or .npz, got {path.name!r}")
