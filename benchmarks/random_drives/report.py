"""Tables of the results on random drives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.random_drives.faults import FAULTS, JITTER
from benchmarks.random_drives.replay import FaultyReplay, Replay
from hybridsep.base.signals import Array

__all__ = ["print_faults", "print_replays"]

QUANTILES = (0.5, 0.9, 0.95, 0.99, 0.995, 1.0)
N_WORST = 10
UM = 1e6


def print_replays(replays: Sequence[Replay], predictor: str) -> None:
    """Print ratios of RMS errors, over all drives and by kind of trajectory, and the worst drives."""
    print(f"{len(replays)} random drives, predictor: {predictor}")
    quantiles = (0.01, 0.1, 0.5, 0.9, 0.99)
    print(f"RMS at quantiles of {', '.join(f'{q:g}' for q in quantiles)}, µm")
    for name in ("rms_pb", "rms_hold", "rms_h"):
        values = _quantiles([getattr(r, name) for r in replays], quantiles)
        print(f"  {name:9}" + "".join(f"{UM * value:12.4g}" for value in values))
    columns = ("mean", "median", "90 %", "95 %", "99 %", "99.5 %", "max", "> 1.02", "> 1.10")
    print(f"{'ratio to (mean: geometric)':28}" + "".join(f"{column:>9}" for column in columns))
    _print_ratios("physics", [r.ratio for r in replays])
    _print_ratios("hold", [r.hold_ratio for r in replays])
    if any(r.rms_arx for r in replays):
        _print_ratios("best of hold, ARX20, ARX40", [r.peer_ratio for r in replays])
    for kind in sorted({r.kind for r in replays}):
        group = [r.ratio for r in replays if r.kind == kind]
        _print_ratios(f"physics, {kind} ({len(group)})", group)
    print(f"diverged: {sum(r.diverged for r in replays)}")
    print("worst:")
    for r in sorted(replays, key=lambda r: -r.ratio)[:N_WORST]:
        print(f"  {r.ratio:.4g} × physics {UM * r.rms_pb:.3g} µm, {r.hold_ratio:.3g} × hold: drive {r.index}, {r.text}")


def print_faults(replays: Sequence[FaultyReplay]) -> None:
    """Print the ratios after each fault, and the largest change of the prediction."""
    print("after a fault of the sensor, ratio to physics (jitter: to the run without)")
    print("change: largest |x_h − x_pb| above 2 × the largest residual of the sound measurement")
    columns = ("median", "90 %", "99 %", "max", "> 1.05", "> 1.10", "change", "refused")
    print(f"{'fault':28}" + "".join(f"{column:>10}" for column in columns))
    for fault in FAULTS:
        group = [r for r in replays if r.fault == fault]
        ratios, changes = np.array([r.ratio for r in group]), np.array([r.change for r in group])
        values = [f"{value:.3g}" for value in _quantiles(ratios, (0.5, 0.9, 0.99, 1.0))]
        values += [_share(ratios, 1.05), _share(ratios, 1.10), _share(changes, 2.0), str(sum(r.refused for r in group))]
        print(f"{fault:28}" + "".join(f"{value:>10}" for value in values))
    jittered = [r for r in replays if r.fault == JITTER]
    own = np.array([r.own_noise for r in jittered])
    print(
        f"the run without jitter, judged by the jittered samples: {_share(own, 1.10)} above 1.10, max {own.max():.3g};"
    )
    beyond = np.array([r.ratio for r in jittered]) / own
    print(f"  jitter relative to that: {_share(beyond, 1.10)} above 1.10, max {beyond.max():.3g}")
    true = np.array([r.true_ratio for r in jittered])
    print(f"  both judged by the samples without jitter: {_share(true, 1.10)} above 1.10, max {true.max():.3g}")


def _print_ratios(name: str, ratios: Sequence[float]) -> None:
    values = np.array(ratios)
    quantiles = "".join(f"{value:9.3g}" for value in _quantiles(values, QUANTILES))
    mean = float(np.exp(np.mean(np.log(values))))
    print(f"{name:28}{mean:9.3g}{quantiles}{_share(values, 1.02):>9}{_share(values, 1.10):>9}")


def _quantiles(values: Sequence[float] | Array, quantiles: Sequence[float]) -> Array:
    """Return quantiles that are values; infinite ones count as the largest."""
    return np.quantile(values, quantiles, method="inverted_cdf")


def _share(values: Array, limit: float) -> str:
    return f"{100 * np.mean(~(values <= limit)):.2f} %"
