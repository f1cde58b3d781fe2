"""Saved state of a predictor: parameters, learned factor, and state of the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import StateError
from ..base.saved import Saved
from ..base.settings import PredictorSettings
from ..base.state import pack, unpack
from ..model.physics import ModalModel, Mode
from .paper.model import PaperModel
from .residual_model import WindowInputs
from .trust.disturbances import Disturbance
from .trust.model import TrustedModel
from .uncertainty import N_LEARNED
from .window import PredictedWindow

if TYPE_CHECKING:
    from .predictor import HybridPredictor

__all__ = ["predictor_blob", "predictor_from"]

_KIND = "predictor"


def predictor_blob(predictor: HybridPredictor) -> bytes:
    """Return parameters and state, a pending window included, as a versioned blob."""
    pending, reference, residual = predictor.pending, predictor.reference_features, predictor.residual.saved()
    meta = {
        "settings": predictor.settings.as_table(),
        **{name: getattr(predictor, name) for name in ("k", "n_init", "start")},
        "dead_time": predictor.model.dead_time,
        "n_disturbances": len(predictor.disturbances),
        "pending_start": None if pending is None else pending.start,
        **residual.meta,
    }
    modes = np.array([[mode.f_n, mode.zeta, mode.alpha, mode.beta] for mode in predictor.model.modes])
    arrays = {
        "modes": modes,
        "state": predictor.state,
        "late": predictor.late,
        **residual.arrays,
        "signs": reference.before,
        "reference": np.array([reference.last]),
        "uncertainty": predictor.uncertainty.learned(),
    }
    if pending is not None:
        arrays |= {f"pending_{name}": getattr(pending, name) for name in ("x_d", "x_pb", "reference", "signs")}
        forecast = predictor.residual.saved_forecast(pending.forecast)
        arrays |= forecast.arrays
        meta |= forecast.meta
    return pack(_KIND, meta, arrays, residual.parts)


def predictor_from(
    kind: type[HybridPredictor], blob: bytes, disturbances: Sequence[Disturbance] = ()
) -> HybridPredictor:
    """Return the predictor of a :func:`predictor_blob`, given the disturbances of the user's own.

    Raises
    ------
    StateError
        If the blob is foreign, truncated or of another version, or the number of disturbances differs.
    """
    saved = Saved(_KIND, *unpack(_KIND, blob))
    if (n := saved.whole("n_disturbances")) != len(disturbances):
        raise StateError(
            f"the saved predictor was learned with {n} disturbances of the user's own, got {len(disturbances)}: they "
            "are functions, which neither a state nor an FMU holds; in Python give them as disturbances="
        )
    with saved.consistent():
        settings = PredictorSettings.from_table(saved.table("settings"))
        (TrustedModel if settings.trust else PaperModel).check_sizes(saved, settings)
        model = ModalModel([Mode(*row) for row in saved.array("modes", None, 4).tolist()], saved.field("dead_time"))
        predictor = kind(model, settings, start=saved.number_or_none("start"), disturbances=disturbances)
    predictor.k, predictor.n_init = saved.whole("k"), saved.whole("n_init")
    predictor.state[:] = saved.array("state", predictor.discrete.n_state)
    predictor.late = saved.array("late", settings.measurement_delay)
    features = predictor.reference_features
    features.before = saved.array("signs", len(features.before))
    features.last = float(saved.array("reference", 1, finite=False)[0])
    predictor.residual.restore(saved)
    learned = saved.array("uncertainty", N_LEARNED, finite=False)
    if not predictor.uncertainty.is_sound(learned):
        raise saved.error("the variances of the errors must be finite and ≥ 0")
    predictor.uncertainty.restore(learned)
    if saved.field("pending_start") is not None:
        predictor.pending = _pending(predictor, saved)
    return predictor


def _pending(predictor: HybridPredictor, saved: Saved) -> PredictedWindow:
    """Return the predicted window; StateError if it is inconsistent."""
    start = saved.real("pending_start")
    x_d, reference = saved.array("pending_x_d", None), saved.array("pending_reference", None)
    if not len(predictor.late) < len(x_d) <= len(reference):
        raise saved.error("the pending window must have samples, and a reference at least as long")
    x_pb = saved.array("pending_x_pb", len(x_d))
    signs = saved.array("pending_signs", len(predictor.reference_features.signs(reference, start)))
    inputs = WindowInputs(x_d, x_pb, start, predictor.reference_features.features(signs, len(x_d)))
    with np.errstate(all="ignore"):
        forecast = predictor.residual.restored_forecast(saved, inputs)  # follows from the state
        return predictor.predicted(forecast, start, reference, signs)
