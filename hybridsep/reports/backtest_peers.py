"""ARX models beside the predictions of a replayed log, for what ``hybridsep backtest`` prints."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.metrics import largest, rms
from ..base.signals import Array
from ..evaluate.backtest import Backtest
from ..evaluate.verdict import Verdict
from ..predict.predictor import HybridPredictor
from ..tune.recordings import Recording, Replay

__all__ = ["BacktestPeers", "backtest_peers"]


@dataclass(frozen=True)
class BacktestPeers:
    """ARX models of a replay, fitted again before each window to all samples so far.

    Attributes
    ----------
    errors : mapping
        Name, such as ``arx20``, → measured minus predicted position, (n,), m; NaN where a measurement is missing. None
        where it diverged.
    active : (n,) array of bool
        Whether the warm-up is over.
    verdict : Verdict
        Verdict on the replay, with these peers.
    """

    errors: Mapping[str, Array | None]
    active: NDArray[np.bool_]
    verdict: Verdict

    def summary(self) -> dict[str, float | str]:
        """Return ``rms_arx20_um``, ``max_arx20_um``, …, as :meth:`~hybridsep.evaluate.scores.Scores.summary` does.

        The figures of one that diverged are ``"diverged"``.
        """
        found: dict[str, float | str] = {}
        for suffix, counted in (("", np.ones(len(self.active), np.bool_)), ("_after_warm_up", self.active)):
            for quantity, figure in (("rms", rms), ("max", largest)):
                for name, errors in self.errors.items():
                    key = f"{quantity}_{name}_um{suffix}"
                    if errors is None:
                        found[key] = "diverged"
                        continue
                    known = errors[counted & ~np.isnan(errors)]
                    found[key] = 1e6 * figure(known) if known.size else math.nan
        return found

    def rms_from(self, first: int) -> dict[str, float]:
        """Return the RMS of each that did not diverge, m, from a sample on."""
        known = {name: errors[first:] for name, errors in self.errors.items() if errors is not None}
        return {name: rms(errors[~np.isnan(errors)]) for name, errors in known.items() if not np.isnan(errors).all()}


def backtest_peers(
    found: Backtest,
    x_d: Array,
    x_meas: Array,
    predictor: HybridPredictor,
    progress: Callable[[float], object] = lambda _done: None,
) -> BacktestPeers:
    """Return the ARX models of a replay.

    Parameters
    ----------
    found : Backtest
    x_d, x_meas : (n,) array, m
        What was replayed.
    predictor : HybridPredictor
        What replayed it.
    progress : callable, optional
        Called with the fraction done.
    """
    whole = (Recording(x_d, x_meas, 0),)
    judged = Replay(whole, (found,), predictor.Np, predictor.settings.measurement_delay).with_peers(progress)
    own, scored = found.verdict, judged.scored()[2:-1]
    errors = {
        peer.name.lower(): None if one.diverged else one.errors for peer, one in zip(judged.peers, scored, strict=True)
    }
    verdict = replace(judged.verdict(), n_rejected=own.n_rejected, n_missing=own.n_missing, n_samples=own.n_samples)
    return BacktestPeers(errors, found.active, verdict)
