"""Residual model with trust and its saved state: what it has learned, and the state of its run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...base.saved import COUNT_MAX, Saved
from ...base.settings import PredictorSettings
from ...base.signals import Array
from ...base.state import pack, unpack
from ..forecast import FeatureScales
from ..residual_model import SavedFields, WindowInputs
from .disturbances import LEAST_VELOCITY, StaticState
from .experts import Evidence, ResidualScale
from .forecast import TrustedForecast
from .learned import LEARNED
from .model import COMMAND, LAGGED, TrustedModel
from .reach import Reach

__all__ = ["SavedTrustedModel"]

_KIND = "trusted model"

_ROUNDING = 1e-6
"""What rounding may have added to the sum of the weights."""


class SavedTrustedModel(TrustedModel):
    """:class:`TrustedModel` that can be saved and restored."""

    @staticmethod
    def check_sizes(saved: Saved, settings: PredictorSettings) -> None:
        """Raise StateError if arrays do not have the sizes of the settings."""
        saved.array("x_pb", settings.q), saved.array("e_pb", settings.p)
        own = _own(saved)
        size = len(own.array("factor", None, None))
        if size <= settings.p:
            raise own.error(f"factor must have more than p = {settings.p} rows, got {size}")

    def saved(self) -> SavedFields:
        """Return the complete state; arrays of zeros confirm the numbers of lags before the model is made."""
        lags = {"x_pb": np.zeros(self.settings.q), "e_pb": np.zeros(self.settings.p)}
        return SavedFields({}, lags, {"trusted": self._blob()})

    def _blob(self) -> bytes:
        run, static = self.run, self.run.static
        meta: dict[str, float] = {
            "n_samples": max(
                self.evidence.this.regression.n_samples, self.evidence_of_command.this.regression.n_samples
            ),
            "n_rejected": self.n_rejected,
            "n_missing": self.reach.n_missing,
            "n_beyond": self.reach.n_beyond,
            "leading": self.leading,
            "look_ahead": self.preview + self.settings.measurement_delay,
        }
        arrays = {
            **self.learned(),
            "n_rows": np.array([self.evidence.this.n_rows, self.evidence_of_command.this.n_rows]),
            "factor": self.evidence.this.regression.factor,
            "factor_of_command": self.evidence_of_command.this.regression.factor,
            "filters": static.filters,
            "filtered": static.filtered,
            "x_d": np.array([static.x_d]),
            "last_x_pb": static.x_pb,
            "commands": run.commands,
            "past": run.past,
            "past_of_command": run.past_of_command,
            "bridged": run.bridged.astype(np.float64),
        }
        for name, evidence in (("", self.evidence), ("_of_command", self.evidence_of_command)):
            if evidence.earlier is not None:
                arrays[f"earlier{name}"] = evidence.earlier.regression.factor
                meta[f"n_earlier{name}"] = evidence.earlier.n_rows
        return pack(_KIND, meta, arrays)

    def restore(self, saved: Saved) -> None:
        """Restore the state of :meth:`saved`; StateError if it is inconsistent: the model must not be used then."""
        saved = _own(saved)
        n_samples = saved.whole("n_samples")
        self.plan_ahead(saved.whole("look_ahead") - self.settings.measurement_delay)
        leading = saved.whole("leading")
        if leading not in (LAGGED, COMMAND):
            raise saved.error("leading must be the place of an expert with lags")
        self.lead(leading)
        learned = {name: saved.array(name, *one.shape) for name, one in self.learned().items()}
        if (problem := self._unsound(learned)) is not None:
            raise saved.error(problem)
        if learned["n_rows"].max() > n_samples:
            raise saved.error("n_rows must be at most n_samples")
        if 0.0 < learned["motion"][0] < LEAST_VELOCITY:
            raise saved.error("the velocity scale must be a velocity, or 0")
        self.restore_learned(learned)
        with saved.consistent():
            self.evidence.this.regression.restore(saved.array("factor", None, None), n_samples)
            self.evidence_of_command.this.regression.restore(saved.array("factor_of_command", None, None), n_samples)
        self.evidence.earlier = _earlier(saved, "", self.evidence.n_features)
        self.evidence_of_command.earlier = _earlier(saved, "_of_command", self.evidence_of_command.n_features)
        run, n = self.run, self.static.n_disturbances
        static = StaticState(
            saved.array("filters", self.static.discrete.n_state, n),
            saved.array("filtered", n),
            float(saved.array("x_d", 1)[0]),
            saved.array("last_x_pb", len(run.static.x_pb)),
        )
        self.run = run._replace(
            static=static,
            **{name: saved.array(name, len(getattr(run, name))) for name in ("commands", "past", "past_of_command")},
            bridged=saved.array("bridged", len(run.bridged)) > 0.0,
        )
        self.n_rejected = saved.whole("n_rejected")
        self.reach = self.reach._replace(n_missing=saved.whole("n_missing"), n_beyond=saved.whole("n_beyond"))

    def saved_forecast(self, forecast: TrustedForecast) -> SavedFields:
        """Return the scales of a forecast, which a compensator has from its preview."""
        scales = forecast.scales
        arrays = {"pending_scales": np.array([scales.velocity, scales.step, *scales.largest])}
        return SavedFields({}, arrays, {})

    def restored_forecast(self, saved: Saved, window: WindowInputs) -> TrustedForecast:
        """Return the forecast of :meth:`saved_forecast`; StateError if it is inconsistent."""
        velocity, step, *largest = saved.array("pending_scales", 2 + self.static.n).tolist()
        if min(velocity, step, *largest) < 0.0:
            raise saved.error("the scales of the pending window must be ≥ 0")
        scales = FeatureScales(velocity, np.array(largest), step)
        forecast = self.forecast(window, scales)
        if not np.isfinite(forecast.e_h).all():
            raise saved.error("the prediction of the pending window must be finite")
        return forecast

    def learned(self) -> dict[str, Array]:
        """Return what has been learned besides the regression, in the order of :data:`LEARNED`."""
        stack, experts = self.stack, self.experts.values()
        return {
            "n_rows": np.array([self.evidence.n_rows, self.evidence_of_command.n_rows]),
            "motion": np.array([self.velocity_scale, self.largest_step, self.reach.fastest]),
            "scale": np.array(self.scale),
            "scale_of_command": np.array(self.scale_of_command),
            "noise_variances": np.array([expert.noise_variance for expert in experts]),
            "correlations": np.array([expert.correlation for expert in experts]),
            "largest": self.largest,
            "weights": stack.weights,
            "gram": stack.gram,
            "cross": stack.cross,
            "evidence": stack.evidence,
        }

    def is_sound(self, learned: Mapping[str, Array]) -> bool:
        """Return whether the numbers of :meth:`learned` are finite and in range."""
        return self._unsound(learned) is None

    def _unsound(self, learned: Mapping[str, Array]) -> str | None:
        """Return what is wrong with numbers of :meth:`learned`; None if they are sound."""
        for name, (least, most) in LEARNED.items():
            if not ((learned[name] >= least) & (learned[name] <= most)).all():  # NaN too
                return f"{name} must be {least:g} … {most:g}"
        if learned["weights"].sum() > 1.0 + _ROUNDING:
            return "the sum of weights must be at most 1"
        return None

    def restore_learned(self, learned: Mapping[str, Array]) -> None:
        """Restore the numbers of :meth:`learned`, which are sound."""
        self.evidence.this.n_rows, self.evidence_of_command.this.n_rows = learned["n_rows"].tolist()
        self.velocity_scale, self.largest_step, fastest = learned["motion"].tolist()
        self.reach = Reach(fastest)
        self.scale = ResidualScale(*learned["scale"].tolist())
        self.scale_of_command = ResidualScale(*learned["scale_of_command"].tolist())
        for expert, noise, correlation in zip(
            self.experts.values(), learned["noise_variances"].tolist(), learned["correlations"].tolist(), strict=True
        ):
            expert.noise_variance, expert.correlation = noise, correlation
        self.largest, stack = learned["largest"], self.stack
        stack.weights, stack.gram, stack.cross = learned["weights"], learned["gram"], learned["cross"]
        stack.evidence = learned["evidence"]


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


def _own(saved: Saved) -> Saved:
    return Saved(_KIND, *unpack(_KIND, saved.part("trusted")))
