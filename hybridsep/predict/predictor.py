"""Predictor of a drive's position, with its saved state: parameters, learned factor, and state of the run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import StateError
from ..base.output import written_whole
from ..base.saved import Saved
from ..base.settings import PredictorSettings
from ..base.state import pack, unpack
from ..model.physics import ModalModel, Mode
from .paper.model import PaperModel
from .residual_model import WindowInputs
from .trust.disturbances import Disturbance
from .trust.saved import SavedTrustedModel
from .uncertainty import N_LEARNED
from .window import PredictedWindow
from .window_predictor import WindowPredictor

__all__ = ["HybridPredictor"]

_KIND = "predictor"


class HybridPredictor(WindowPredictor):
    """Predictor of a drive's position by windows, learning from their measurement; eqs. (2) to (6).

    For each window, call :meth:`predict` with its commands, then :meth:`update` with the measured positions.
    :meth:`predict` does not change the weights. Memory and cost per window are constant. With a ``measurement_delay``
    what arrives over a window was measured so many samples earlier; what is not measured yet is predicted anew.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``, eq. (15).
    settings : PredictorSettings, optional
        The defaults if left out.
    start : float, optional
        Initial position, m, at rest; the first command if left out. Positions are relative to it internally, because
        ridge regression is not invariant to an offset.
    disturbances : sequence of Disturbance, optional
        With trust: more candidate disturbances, functions ``d(x, v)`` of positions, m, and commanded velocities, m/s,
        ``(n,)`` each, in any unit; what they are worth is learned. A compensator follows their slopes, taken over the
        motion of a sample. They are not part of a saved state, or of an FMU.

    Raises
    ------
    ParameterError
        If disturbances are given without trust, or are not functions.
    """

    def to_bytes(self) -> bytes:
        """Return parameters and state, a pending window included, as a versioned blob."""
        pending, residual = self.pending, self.residual.saved()
        meta = {
            "settings": self.settings.as_table(),
            **{name: getattr(self, name) for name in ("k", "n_init", "start")},
            "dead_time": self.model.dead_time,
            "n_disturbances": len(self.disturbances),
            "pending_start": None if pending is None else pending.start,
            **residual.meta,
        }
        modes = np.array([[mode.f_n, mode.zeta, mode.alpha, mode.beta] for mode in self.model.modes])
        arrays = {
            "modes": modes,
            "state": self.state,
            "late": self.late,
            **residual.arrays,
            "uncertainty": self.uncertainty.learned(),
        }
        if pending is not None:
            arrays |= {"pending_x_d": pending.forecast.x_d, "pending_x_pb": pending.forecast.x_pb}
            forecast = self.residual.saved_forecast(pending.forecast)
            arrays |= forecast.arrays
            meta |= forecast.meta
        return pack(_KIND, meta, arrays, residual.parts)

    @classmethod
    def from_bytes(cls, blob: bytes, disturbances: Sequence[Disturbance] = ()) -> HybridPredictor:
        """Return the predictor of :meth:`to_bytes`, given the ``disturbances`` that it was learned with.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version, or the number of disturbances differs.
        """
        saved = Saved(_KIND, *unpack(_KIND, blob))
        if (n := saved.whole("n_disturbances")) != len(disturbances):
            raise StateError(
                f"the saved predictor was learned with {n} disturbances of the user's own, got {len(disturbances)}: "
                "they are functions, which neither a state nor an FMU holds; in Python give them as disturbances="
            )
        with saved.consistent():
            settings = PredictorSettings.from_table(saved.table("settings"))
            (SavedTrustedModel if settings.trust else PaperModel).check_sizes(saved, settings)
            model = ModalModel([Mode(*row) for row in saved.array("modes", None, 4).tolist()], saved.field("dead_time"))
            predictor = cls(model, settings, start=saved.number_or_none("start"), disturbances=disturbances)
        predictor.k, predictor.n_init = saved.whole("k"), saved.whole("n_init")
        predictor.state[:] = saved.array("state", predictor.discrete.n_state)
        predictor.late = saved.array("late", settings.measurement_delay)
        predictor.residual.restore(saved)
        learned = saved.array("uncertainty", N_LEARNED, finite=False)
        if not predictor.uncertainty.is_sound(learned):
            raise saved.error("the variances of the errors must be finite and ≥ 0")
        predictor.uncertainty.restore(learned)
        if saved.field("pending_start") is not None:
            predictor.pending = _pending(predictor, saved)
        return predictor

    def __reduce__(self) -> tuple[Any, ...]:
        # By the saved state: the lags are views, which a plain copy would detach.
        return HybridPredictor.from_bytes, (self.to_bytes(), self.disturbances)

    def save(self, path: str | Path) -> None:
        """Write :meth:`to_bytes` to a file."""
        blob = self.to_bytes()
        with written_whole(path) as file:
            file.write(blob)

    @classmethod
    def load(cls, path: str | Path, disturbances: Sequence[Disturbance] = ()) -> HybridPredictor:
        """Return the predictor of :meth:`save`; :meth:`restart` then begins a warm-started run.

        Raises
        ------
        StateError
            If the file is not a saved predictor, or was learned with another number of disturbances.
        """
        return cls.from_bytes(Path(path).read_bytes(), disturbances)


def _pending(predictor: HybridPredictor, saved: Saved) -> PredictedWindow:
    """Return the predicted window; StateError if it is inconsistent."""
    start = saved.real("pending_start")
    x_d = saved.array("pending_x_d", None)
    if not len(predictor.late) < len(x_d):
        raise saved.error("the pending window must have samples")
    x_pb = saved.array("pending_x_pb", len(x_d))
    with np.errstate(all="ignore"):
        forecast = predictor.residual.restored_forecast(saved, WindowInputs(x_d, x_pb, start))  # follows from the state
        return predictor.predicted(forecast, start)
