"""Saved state of the residual model with trust: what it has learned, and the state of its run."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...base.saved import Saved
from ...base.settings import PredictorSettings
from ...base.signals import PREDICTION_MAX, Array
from ...base.state import pack, unpack
from ..forecast import FeatureScales
from ..residual_model import SavedFields
from .blend import Blend
from .candidates import CORRELATION_MAX, ResidualScale
from .change import ChangeTest
from .disturbances import LEAST_VELOCITY, StaticState
from .guard import N_STATE
from .rest import N_REST

if TYPE_CHECKING:
    from .model import TrustedModel

__all__ = ["check_sizes", "forecast_fields", "restore_trusted", "saved_scales", "trusted_fields"]

_KIND, _CHANGE = "trusted model", "change test"

_CHANGE_NUMBERS = (
    "n_before",
    "n_after",
    "n_carried",
    "peak",
    "largest_square",
    "largest",
    "errors",
    "errors_with_less",
)

_ROUNDING = 1e-6
"""Relative tolerance of what rounding may have changed."""


def trusted_fields(model: TrustedModel) -> SavedFields:
    """Return the complete state; arrays of zeros confirm the numbers of lags before the model is made."""
    lags = {"x_pb": np.zeros(model.settings.q), "e_pb": np.zeros(model.settings.p)}
    return SavedFields({}, lags, {"trusted": _blob(model)})


def check_sizes(saved: Saved, settings: PredictorSettings) -> None:
    """Raise StateError if the arrays of :func:`trusted_fields` do not have the sizes of the settings."""
    saved.array("x_pb", settings.q), saved.array("e_pb", settings.p)
    own = _own(saved)
    size = len(own.array("factor", None, None))
    if size <= settings.p:
        raise own.error(f"factor must have more than p = {settings.p} rows, got {size}")


def forecast_fields(scales: FeatureScales) -> SavedFields:
    """Return the fields of the scales of a pending window."""
    arrays = {"pending_scales": np.array([scales.velocity, *scales.largest])}
    return SavedFields({"pending_rest": scales.n_rest}, arrays, {})


def saved_scales(saved: Saved, n_static: int) -> FeatureScales:
    """Return the scales of :func:`forecast_fields`, with ``n_static`` features; StateError if one is negative."""
    velocity, *largest = saved.array("pending_scales", 1 + n_static).tolist()
    if min(velocity, *largest) < 0.0:
        raise saved.error("the scales of the pending window must be ≥ 0")
    n_rest = saved.whole("pending_rest") if "pending_rest" in saved.meta else 0  # earlier builds have none
    return FeatureScales(velocity, np.array(largest), n_rest)


def restore_trusted(model: TrustedModel, predictor: Saved) -> None:
    """Restore the state of :func:`trusted_fields`, among a predictor's, in a model with the same settings.

    Raises
    ------
    StateError
        If a field is missing or inconsistent; the model must not be used then.
    """
    saved = _own(predictor)
    with saved.consistent():
        model.regression.restore(saved.array("factor", None, None), saved.whole("n_samples"))
    model.plan_ahead(saved.whole("look_ahead") - model.settings.measurement_delay)
    model.n_rows, model.velocity_scale = saved.real("n_rows"), saved.real("velocity_scale")
    if not 0.0 <= model.n_rows <= model.regression.n_samples:
        raise saved.error("n_rows must be from 0 to n_samples")
    if not (model.velocity_scale == 0.0 or LEAST_VELOCITY <= model.velocity_scale <= PREDICTION_MAX):
        raise saved.error("velocity_scale must be a velocity, or 0")
    model.largest = _magnitudes(saved, "largest", model.static.n)
    model.scale = _scale(saved)
    for candidate, (variance, correlation) in zip(
        model.candidates, _magnitudes(saved, "candidates", len(model.candidates), 2).tolist(), strict=True
    ):
        if not 1.0 <= correlation <= CORRELATION_MAX:
            raise saved.error(f"the correlation of a candidate must be 1 … {CORRELATION_MAX:g}, got {correlation}")
        candidate.noise_variance, candidate.correlation = variance, correlation
    _restore_blend(model.blend, saved)
    model.state = StaticState(
        saved.array("filters", model.static.discrete.n_state, model.static.n_disturbances),
        saved.array("filtered", model.static.n_disturbances),
        float(saved.array("x_d", 1)[0]),
        saved.array("x_pb", len(model.state.x_pb)),
    )
    model.past = saved.array("past", len(model.past))
    model.past_bridged = saved.array("past_bridged", len(model.past)) > 0.0
    model.n_rejected = saved.whole("n_rejected")
    with saved.consistent():
        model.guard.restore(saved.array("guard", N_STATE, finite=False))
    if "rest" in saved.arrays:  # earlier builds have none
        with saved.consistent():
            model.rest.restore(saved.array("rest", N_REST))
    model.change = None
    if "change" in saved.parts:
        model.change = _restored_change(model, Saved(_CHANGE, *unpack(_CHANGE, saved.part("change"))))


def _blob(model: TrustedModel) -> bytes:
    state, blend = model.state, model.blend
    meta = {
        "n_samples": model.regression.n_samples,
        **{name: getattr(model, name) for name in ("n_rows", "velocity_scale", "n_rejected")},
        "look_ahead": model.preview + model.settings.measurement_delay,
    }
    arrays = {
        "factor": model.regression.factor,
        "largest": model.largest,
        "scale": np.array(model.scale),
        "candidates": np.array([[one.noise_variance, one.correlation] for one in model.candidates]),
        **{name: getattr(blend, name) for name in ("gram", "cross", "weights")},
        "filters": state.filters,
        "filtered": state.filtered,
        "x_d": np.array([state.x_d]),
        "x_pb": state.x_pb,
        "past": model.past,
        "past_bridged": model.past_bridged.astype(np.float64),
        "guard": np.array(model.guard.state()),
        "rest": np.array(model.rest.state()),
    }
    change = model.change
    parts = {} if change is None else {"change": _change_blob(change)}
    return pack(_KIND, meta, arrays, parts)


def _own(saved: Saved) -> Saved:
    return Saved(_KIND, *unpack(_KIND, saved.part("trusted")))


def _change_blob(change: ChangeTest) -> bytes:
    numbers = np.array([getattr(change, name) for name in _CHANGE_NUMBERS])
    arrays = {"before": change.before.factor, "after": change.after.factor, "numbers": numbers}
    arrays["correlations"], arrays["evidence"] = np.array(change.correlations), np.array([change.evidence])
    counts = {"n_samples": change.after.n_samples, "n_earlier": change.before.n_samples}
    return pack(_CHANGE, counts, arrays)


def _restored_change(model: TrustedModel, saved: Saved) -> ChangeTest:
    correlations = tuple(_magnitudes(saved, "correlations", len(model.candidates)).tolist())
    change = ChangeTest(model.regression, 0.0, correlations)
    with saved.consistent():
        change.before.restore(saved.array("before", None, None), saved.whole("n_earlier"))
        change.after.restore(saved.array("after", None, None), saved.whole("n_samples"))
    numbers = _magnitudes(saved, "numbers", len(_CHANGE_NUMBERS)).tolist()
    for name, number in zip(_CHANGE_NUMBERS, numbers, strict=True):
        setattr(change, name, number)
    change.evidence = float(saved.array("evidence", 1)[0])
    if not 1.0 <= min(correlations) <= max(correlations) <= CORRELATION_MAX:
        raise saved.error(f"the correlations must be 1 … {CORRELATION_MAX:g}, got {correlations}")
    if not (0.0 < change.n_before <= change.n_carried and change.n_after <= change.after.n_samples):
        raise saved.error("n_before must be > 0 and at most n_carried, and n_after at most n_samples")
    if change.largest_square > (1.0 + _ROUNDING) * change.largest**2 + 1e-300:
        raise saved.error("largest_square must be at most the square of largest")
    return change


def _scale(saved: Saved) -> ResidualScale:
    scale = ResidualScale(*_magnitudes(saved, "scale", len(ResidualScale._fields)).tolist())
    # A mean square is at most the square of the largest residual, but for rounding and underflow.
    bounds = (scale.recent, scale.largest_square, scale.largest**2)
    if any(first > (1.0 + _ROUNDING) * second + 1e-300 for first, second in pairwise(bounds)):
        raise saved.error("recent, largest_square and largest² of the scale must ascend")
    return scale


def _restore_blend(blend: Blend, saved: Saved) -> None:
    n = len(blend.first)
    gram, cross, weights = saved.array("gram", n, n), saved.array("cross", n), _magnitudes(saved, "weights", n)
    most = _ROUNDING * np.abs(gram).max()
    if np.abs(gram - gram.T).max() > most or np.linalg.eigvalsh(gram)[0] < -most:
        raise saved.error("the gram matrix must be symmetric and positive semidefinite")
    if weights.sum() > 1.0 + _ROUNDING:
        raise saved.error("the sum of the weights must be at most 1")
    blend.gram, blend.cross, blend.weights = gram, cross, weights


def _magnitudes(saved: Saved, name: str, *shape: int) -> Array:
    """Return an array of finite numbers ≥ 0."""
    array = saved.array(name, *shape)
    if array.min() < 0.0:
        raise saved.error(f"{name} must be ≥ 0")
    return array
