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
from .disturbances import Disturbance
from .features import FeatureLayout
from .forecast import FeatureScales
from .reference_features import N_REFERENCE
from .saved_trusted import restore_trusted, trusted_blob, trusted_fields
from .uncertainty import N_LEARNED
from .window import PredictedWindow

if TYPE_CHECKING:
    from .predictor import HybridPredictor

__all__ = ["predictor_blob", "predictor_from"]

_KIND = "predictor"


def predictor_blob(predictor: HybridPredictor) -> bytes:
    """Return parameters and state, a pending window included, as a versioned blob."""
    pending, past, reference = predictor.pending, predictor.past, predictor.reference_features
    meta = {
        "settings": predictor.settings.as_table(),
        **{name: getattr(predictor, name) for name in ("k", "n_init", "start")},
        "dead_time": predictor.model.dead_time,
        "n_disturbances": len(predictor.disturbances),
        "pending_start": None if pending is None else pending.start,
    }
    learned = {}
    if predictor.trusted is None:
        meta["n_samples"] = predictor.regression.n_samples
        learned["factor"] = predictor.regression.factor
    modes = np.array([[mode.f_n, mode.zeta, mode.alpha, mode.beta] for mode in predictor.model.modes])
    arrays = {
        "modes": modes,
        "state": predictor.state,
        "late": predictor.late,
        "x_pb": past.x_pb,
        "e_pb": past.e_pb,
        **learned,
        "signs": reference.before,
        "reference": np.array([reference.last]),
        "uncertainty": predictor.uncertainty.learned(),
    }
    if pending is not None:
        arrays |= {f"pending_{name}": getattr(pending, name) for name in ("x_d", "x_pb", "reference", "signs")}
        if pending.forecast is not None:
            scales = pending.forecast.scales
            arrays["pending_scales"] = np.array([scales.velocity, *scales.largest])
            meta["pending_rest"] = scales.n_rest
    parts = {} if predictor.trusted is None else {"trusted": trusted_blob(predictor.trusted)}
    return pack(_KIND, meta, arrays, parts)


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
        # Sizes are confirmed by the arrays before anything is allocated from them.
        x_pb, e_pb = saved.array("x_pb", settings.q), saved.array("e_pb", settings.p)
        n = FeatureLayout(settings.p, settings.q, N_REFERENCE if settings.v_friction > 0 else 0).n
        factor = None if settings.trust else saved.array("factor", n + 1, n + 1)
        model = ModalModel([Mode(*row) for row in saved.array("modes", None, 4).tolist()], saved.field("dead_time"))
        trusted = trusted_fields(saved.part("trusted"), settings.p) if settings.trust else None
        predictor = kind(model, settings, start=saved.number_or_none("start"), disturbances=disturbances)
        if factor is not None:
            predictor.regression.restore(factor, saved.whole("n_samples"))
    predictor.k, predictor.n_init = saved.whole("k"), saved.whole("n_init")
    predictor.state[:] = saved.array("state", predictor.discrete.n_state)
    predictor.late = saved.array("late", settings.measurement_delay)
    predictor.past.x_pb[:], predictor.past.e_pb[:] = x_pb, e_pb
    features = predictor.reference_features
    features.before = saved.array("signs", len(features.before))
    features.last = float(saved.array("reference", 1, finite=False)[0])
    if predictor.trusted is not None and trusted is not None:
        restore_trusted(predictor.trusted, trusted)
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
    scales = None
    if predictor.trusted is not None:
        velocity, *largest = saved.array("pending_scales", 1 + predictor.trusted.static.n).tolist()
        if min(velocity, *largest) < 0.0:
            raise saved.error("the scales of the pending window must be ≥ 0")
        n_rest = saved.whole("pending_rest") if "pending_rest" in saved.meta else 0  # earlier builds have none
        scales = FeatureScales(velocity, np.array(largest), n_rest)
    with np.errstate(all="ignore"):
        e_h, pending = predictor.predicted(x_d, x_pb, start, reference, signs, scales)  # follow from the state
    if predictor.trusted is not None and not np.isfinite(e_h).all():
        raise saved.error("the prediction of the pending window must be finite")
    return pending
