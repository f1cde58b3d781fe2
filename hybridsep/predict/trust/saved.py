"""Saved state of the residual model with trust: what it has learned, and the state of its run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base.saved import COUNT_MAX, Saved
from ...base.settings import PredictorSettings
from ...base.state import pack, unpack
from ..forecast import FeatureScales
from ..residual_model import SavedFields
from .disturbances import LEAST_VELOCITY, StaticState
from .experts import Evidence
from .guard import N_STATE
from .learned import learned_numbers, restore_learned, unsound
from .rest import N_REST

if TYPE_CHECKING:
    from .model import TrustedModel

__all__ = ["check_sizes", "forecast_fields", "restore_trusted", "saved_scales", "trusted_fields"]

_KIND = "trusted model"


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
    arrays = {"pending_scales": np.array([scales.velocity, scales.step, *scales.largest])}
    return SavedFields({"pending_rest": scales.n_rest}, arrays, {})


def saved_scales(saved: Saved, n_static: int) -> FeatureScales:
    """Return the scales of :func:`forecast_fields`, with ``n_static`` features; StateError if one is negative."""
    velocity, step, *largest = saved.array("pending_scales", 2 + n_static).tolist()
    if min(velocity, step, *largest) < 0.0:
        raise saved.error("the scales of the pending window must be ≥ 0")
    return FeatureScales(velocity, np.array(largest), step, saved.whole("pending_rest"))


def restore_trusted(model: TrustedModel, predictor: Saved) -> None:
    """Restore the state of :func:`trusted_fields`, among a predictor's, in a model with the same settings.

    Raises
    ------
    StateError
        If a field is missing or inconsistent; the model must not be used then.
    """
    saved = _own(predictor)
    n_samples = saved.whole("n_samples")
    model.plan_ahead(saved.whole("look_ahead") - model.settings.measurement_delay)
    learned = {name: saved.array(name, *one.shape, finite=False) for name, one in learned_numbers(model).items()}
    if (problem := unsound(model, learned)) is not None:
        raise saved.error(problem)
    if learned["n_rows"].max() > n_samples:
        raise saved.error("n_rows must be at most n_samples")
    if 0.0 < learned["motion"][0] < LEAST_VELOCITY:
        raise saved.error("the velocity scale must be a velocity, or 0")
    restore_learned(model, learned)
    with saved.consistent():
        model.evidence.this.regression.restore(saved.array("factor", None, None), n_samples)
        model.evidence_of_command.this.regression.restore(saved.array("factor_of_command", None, None), n_samples)
    model.evidence.earlier = _earlier(saved, "", model.evidence.n_features)
    model.evidence_of_command.earlier = _earlier(saved, "_of_command", model.evidence_of_command.n_features)
    run, n = model.run, model.static.n_disturbances
    static = StaticState(
        saved.array("filters", model.static.discrete.n_state, n),
        saved.array("filtered", n),
        float(saved.array("x_d", 1)[0]),
        saved.array("last_x_pb", len(run.static.x_pb)),
    )
    model.run = run._replace(
        static=static,
        **{name: saved.array(name, len(getattr(run, name))) for name in ("commands", "past", "past_of_command")},
        bridged=saved.array("bridged", len(run.bridged)) > 0.0,
    )
    model.n_rejected = saved.whole("n_rejected")
    with saved.consistent():
        model.guard.restore(saved.array("guard", N_STATE, finite=False))
        model.rest.restore(saved.array("rest", N_REST))


def _earlier(saved: Saved, name: str, n_features: int) -> Evidence | None:
    """Return the evidence of earlier runs, if there is any."""
    if f"earlier{name}" not in saved.arrays:
        return None
    n_rows = saved.real(f"n_earlier{name}")
    if not 0.0 < n_rows <= COUNT_MAX:
        raise saved.error(f"n_earlier{name} must be > 0 and at most {COUNT_MAX:g}")
    evidence = Evidence.none(n_features)
    with saved.consistent():
        evidence.regression.restore(saved.array(f"earlier{name}", None, None), 0)
    evidence.n_rows = n_rows
    return evidence


def _blob(model: TrustedModel) -> bytes:
    run, static = model.run, model.run.static
    meta: dict[str, float] = {
        "n_samples": max(model.evidence.this.regression.n_samples, model.evidence_of_command.this.regression.n_samples),
        "n_rejected": model.n_rejected,
        "look_ahead": model.preview + model.settings.measurement_delay,
    }
    arrays = {
        **learned_numbers(model),
        "n_rows": np.array([model.evidence.this.n_rows, model.evidence_of_command.this.n_rows]),
        "factor": model.evidence.this.regression.factor,
        "factor_of_command": model.evidence_of_command.this.regression.factor,
        "filters": static.filters,
        "filtered": static.filtered,
        "x_d": np.array([static.x_d]),
        "last_x_pb": static.x_pb,
        "commands": run.commands,
        "past": run.past,
        "past_of_command": run.past_of_command,
        "bridged": run.bridged.astype(np.float64),
        "guard": np.array(model.guard.state()),
        "rest": np.array(model.rest.state()),
    }
    for name, evidence in (("", model.evidence), ("_of_command", model.evidence_of_command)):
        if evidence.earlier is not None:
            arrays[f"earlier{name}"] = evidence.earlier.regression.factor
            meta[f"n_earlier{name}"] = evidence.earlier.n_rows
    return pack(_KIND, meta, arrays)


def _own(saved: Saved) -> Saved:
    return Saved(_KIND, *unpack(_KIND, saved.part("trusted")))
