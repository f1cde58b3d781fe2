"""Tracking error to be expected of a compensator on recorded commands: an estimate before anything is compensated.

The drive is taken for ``x = G_pb x_dm + r``: the identified model, and the residual ``r`` as it was recorded. The
compensator plans and learns on it in closed loop. That ``r`` would change with the command is left out; friction does
so where a modified command turns elsewhere.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..base.settings import CompensatorSettings, PredictorSettings
from ..base.signals import Array
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor
from .compensator import SepCompensator

_BINDS, _SAID = 0.99, 0.001
"""Share of a limit from which on a sample of a command counts as bound by it, and share of the samples from which on a
limit counts: fewer cost nothing that could be seen."""


def limits_that_bind(x_d: Array, x_dm: Array, T_s: float, settings: CompensatorSettings) -> dict[str, float]:
    """Return which limits bind a modified command ``(n,)``, m: the share of the samples, 0 … 1, by the limit's name.

    Names are as in FMUs, such as ``change_max``; limits that bind in fewer than 0.1 % are left out.
    """
    limits = () if settings.limits is None else settings.limits.to_fmi().items()
    sizes = [(name, np.abs(np.diff(x_dm, i)) / T_s**i, limit) for i, (name, limit) in enumerate(limits, start=1)]
    if settings.change_max is not None:
        sizes.append(("change_max", np.abs(x_dm - x_d), settings.change_max))
    shares = {name: np.count_nonzero(size >= _BINDS * limit) / len(x_d) for name, size, limit in sizes}
    return {name: share for name, share in shares.items() if share >= _SAID}


class Expected(NamedTuple):
    """Commanded minus measured position without and with compensation, and the commands of the latter, ``(n,)``, m."""

    without: Array
    compensated: Array
    x_d: Array
    x_dm: Array


def expected_errors(
    model: ModalModel,
    settings: PredictorSettings,
    compensator: CompensatorSettings,
    recordings: Sequence[tuple[Array, Array]],
    *,
    learn: bool = True,
) -> Iterator[Expected]:
    """Yield the tracking errors to be expected of one recording each.

    ``model``: ``G_pb``; ``recordings``: sequence of pairs ``(x_d, x)`` of (n,), m: ``x`` as it arrives, with the
    ``measurement_delay`` of the settings; NaN where it is missing. The errors of what has not arrived at its end are
    left out. Where the compensator is not to ``learn``, the physics model plans, for a drive that may be exactly it.
    """
    planner = SepCompensator(HybridPredictor(model, settings), compensator)
    discrete, Np, late = model.discretise(settings.T_s, settings.input_hold), settings.Np, settings.n_late
    for i, (x_d, x) in enumerate(recordings):
        if i or not learn:
            planner.restart(float(x_d[0]), lead_in=0 if learn else len(x_d) + settings.Np)
        n, start = len(x_d) - late, float(x_d[0])
        if n < 1:
            continue
        command = np.concatenate((x_d, np.full(planner.preview, x_d[-1])))
        x_pb = discrete.forced_response(discrete.rest(), x_d - start)[0] + start
        residual = np.concatenate((x[late:] - x_pb[:n], np.zeros(late + Np)))
        state, on_the_way, true = discrete.rest(), np.full(late, start), np.empty(0)
        x_dm = np.empty(0)
        for k in range(0, n, Np):
            window = planner.plan(command[k : k + planner.preview])
            response, state = discrete.forced_response(state, window.x_dm - start)
            x_dm = np.concatenate((x_dm, window.x_dm))
            moved = response + start + residual[k : k + Np]
            true = np.concatenate((true, moved))
            arrived = np.concatenate((on_the_way, moved))
            planner.update(arrived[:Np])
            on_the_way = arrived[Np:]
        yield Expected(x_d[:n] - x[late:], x_d[:n] - true[:n], x_d[:n], x_dm[:n])
