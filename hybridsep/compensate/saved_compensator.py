"""Saved state of a compensator: parameters and state, predictor and planned window included."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.saved import Saved
from ..base.settings import CompensatorSettings
from ..base.state import pack, unpack
from ..predict.predictor import HybridPredictor
from ..predict.trust.disturbances import Disturbance
from ..predict.window import Prediction
from .plan import PendingPlan, SepState

if TYPE_CHECKING:
    from .compensator import SepCompensator

__all__ = ["compensator_blob", "compensator_from"]

_KIND = "compensator"


def compensator_blob(compensator: SepCompensator) -> bytes:
    """Return parameters and state as a versioned blob."""
    pending, planning = compensator._pending, compensator._planning
    meta = {
        "settings": compensator.settings.as_table(),
        "lead_in": compensator.lead_in,
        "excess": planning.monitor.excess,
        "measured_before": planning.measured_before,
        "state_before": int(compensator._state_before),
        "pending": None if pending is None else [int(pending.state), pending.prediction.n_warm_up],
    }
    arrays = {
        "rest": compensator._rest,
        "delta_before": compensator._delta_before,
        "x_d_before": compensator._x_d_before,
        "sensor": np.array(planning.sensor.state()),
    }
    if pending is not None:
        arrays |= {"coefficients": pending.coefficients, "delta": pending.delta, "x_d": pending.x_d}
        arrays |= {name: getattr(pending.prediction, name) for name in ("x_pb", "e_h", "x_h_std")}
    return pack(_KIND, meta, arrays, {"predictor": compensator.predictor.to_bytes()})


def compensator_from(
    kind: type[SepCompensator], blob: bytes, disturbances: Sequence[Disturbance] = ()
) -> SepCompensator:
    """Return the compensator of :func:`compensator_blob`, given its predictor's disturbances of the user's own.

    Raises
    ------
    StateError
        If the blob is foreign, truncated or of another version, or the number of disturbances differs.
    """
    saved = Saved(_KIND, *unpack(_KIND, blob))
    predictor = HybridPredictor.from_bytes(saved.part("predictor"), disturbances)
    restored = HybridPredictor.from_bytes(saved.part("predictor"), disturbances)
    with saved.consistent():
        compensator = kind(predictor, CompensatorSettings.from_table(saved.table("settings")))
    compensator.predictor = restored  # the constructor has restarted the other one
    compensator.lead_in = saved.whole("lead_in")
    planning = compensator._planning
    planning.monitor.excess, planning.measured_before = saved.real("excess"), saved.flag("measured_before")
    before = saved.whole("state_before")
    if before not in tuple(SepState):
        raise saved.error("state_before must be a state")
    compensator._state_before = SepState(before)
    n, Np = len(compensator._rest), predictor.Np
    compensator._rest, compensator._delta_before = saved.array("rest", n), saved.array("delta_before", 3)
    compensator._x_d_before = saved.array("x_d_before", 3, finite=False)
    with saved.consistent():
        planning.sensor.restore(saved.array("sensor", 5, finite=False))
    if saved.field("pending") is not None:
        state, n_warm_up = saved.numbers("pending", 2)
        if state not in tuple(SepState) or n_warm_up not in range(Np + 1) or restored.n_pending != Np:
            raise saved.error("the pending window must be planned and predicted")
        # A hybrid prediction that is not used may diverge.
        prediction = Prediction(
            saved.array("x_pb", Np), saved.array("e_h", Np, finite=False), saved.array("x_h_std", Np), int(n_warm_up)
        )
        compensator._pending = PendingPlan(
            saved.array("coefficients", n),
            saved.array("delta", Np),
            saved.array("x_d", Np),
            prediction,
            SepState(int(state)),
        )
    return compensator
