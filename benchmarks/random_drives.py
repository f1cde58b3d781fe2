"""The predictor replayed on random nonlinear drives whose physics model is 20 or 40 % wrong.

    python -m benchmarks.random_drives [--n 1000] [--faults] [--predictor default] [--core]
    python -m benchmarks.random_drives --generator two_mass [--peers] …

Drives are of 1 to 4 modes with a model 20 % wrong, at 1 kHz, or of two masses in a cascaded position loop with a model
40 % wrong, at 250 Hz to 8 kHz. RMS against the measured position over the whole run, relative to the physics model
alone, to the hold (the physics model plus the last measured residual, in every window from the first) and with
``--peers`` to the best of hold and two ARX models in hindsight.
"""

import argparse
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from random_drives import generator as modal
from random_drives.drive import Drive
from random_drives.replay import PREDICTORS, Replayed, library_replay, physics_alone
from two_mass import generator as two_mass

from benchmarks.sensor_faults import FAULTS, JITTER, OFFSET_STEP
from hybridsep.base.errors import SignalError
from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.evaluate.peers import Piece, predict_peers


@dataclass(frozen=True)
class Generator:
    """A generator of random drives."""

    # seed and number of the drives that figures are given for; drives of one task
    seed: int
    n: int
    chunk: int
    # returns the true positions, m, of drives, from their indices and ``seed=``
    true_positions: Callable[..., list[Array]]
    # returns drives from their indices, true positions and seed
    drives_at: Callable[[Sequence[int], Sequence[Array], int], Sequence[Drive]]


GENERATORS = {
    "modal": Generator(modal.SEED, 1000, modal.CHUNK, modal.true_positions, modal.drives_at),
    "two_mass": Generator(two_mass.SEED, 250, two_mass.CHUNK, two_mass.true_positions, two_mass.drives_at),
}


DIVERGED = 1.0  # largest prediction error, m, beyond which a prediction counts as diverged: beyond any of the strokes


@dataclass(frozen=True)
class Replay:
    """Result of one drive."""

    index: int
    kind: str  # of the trajectory
    # RMS errors against the measured position over the whole run, m; ``rms_h`` is infinite where the replay ended with
    # an error
    rms_pb: float
    rms_hold: float
    rms_h: float
    largest: float  # largest error of ``x_h``, m
    # RMS errors of the refitted ARX peers, m, if they were asked for; infinite where one diverged
    rms_arx: tuple[float, ...] = ()

    @property
    def ratio(self) -> float:
        """RMS relative to the physics model's."""
        return self.rms_h / self.rms_pb

    @property
    def hold_ratio(self) -> float:
        """RMS relative to the hold's."""
        return self.rms_h / self.rms_hold

    @property
    def peer_ratio(self) -> float:
        """RMS relative to the best of hold and the ARX peers, in hindsight."""
        return self.rms_h / min(self.rms_hold, *self.rms_arx)

    @property
    def diverged(self) -> bool:
        """Whether the prediction left the axis."""
        return not self.largest <= DIVERGED


def replay(drive: Drive, predictor: str, run: Replayed = library_replay, *, peers: bool = False) -> Replay:
    """Return the result of a predictor on a drive, with ``peers`` beside the ARX models refitted before each window."""
    x_pb, Np = physics_alone(drive), drive.settings.Np
    x_hold = _hold(x_pb, drive.x_meas, Np)
    arx = predict_peers([Piece(drive.x_d, drive.x_meas, 0, 0)], Np) if peers else ()
    try:
        error = drive.x_meas - run(predictor, drive.model, drive.settings, drive.x_d, drive.x_meas)
        rms_h, largest = rms(error), float(np.abs(error).max())
    except SignalError:
        rms_h = largest = math.inf
    rms_pb, rms_hold = rms(drive.x_meas - x_pb), rms(drive.x_meas - x_hold)
    rms_arx = tuple(math.inf if one.diverged else rms(drive.x_meas - one.predictions[0]) for one in arx)
    return Replay(drive.index, drive.kind, rms_pb, rms_hold, rms_h, largest, rms_arx)


def _hold(x_pb: Array, x_meas: Array, Np: int) -> Array:
    """Return ``x_pb`` plus the last residual measured before each window, ``(n,)``, m."""
    last = np.concatenate(([0.0], (x_meas - x_pb)[Np - 1 :: Np]))
    return np.asarray(x_pb + np.repeat(last, Np)[: len(x_pb)])


@dataclass(frozen=True)
class FaultyReplay:
    """Result of one drive with a faulty sensor, after the fault."""

    index: int
    fault: str
    # RMS against the sound measurement relative to the physics model's (with jitter: to the run without); infinite
    # where the replay ended with an error
    ratio: float
    # largest ``|x_h − x_pb|`` over the whole run relative to the largest residual of the sound measurement
    change: float
    refused: bool  # whether the replay ended with an error
    # with jitter: the prediction of the run without it, judged by the jittered samples, in the same ratio. Jitter that
    # costs the prediction no accuracy comes to this: the noise of the samples themselves cannot be predicted
    own_noise: float = math.nan


def replay_faults(drive: Drive, seed: int, predictor: str, run: Replayed = library_replay) -> list[FaultyReplay]:
    """Return the results of a predictor on a drive with each of the faults, which follow from ``seed``."""
    x_pb = physics_alone(drive)
    settings, T_s, replays = drive.settings, drive.settings.T_s, []
    for number, (name, fault) in enumerate(FAULTS.items()):
        measured, last = fault(drive.x_meas, T_s, np.random.default_rng((seed, drive.index, number)))
        # What a prediction should agree with, and from which sample on
        sound, first = drive.x_meas, last + 1 + settings.p + 2 * settings.Np
        if name == OFFSET_STEP:
            sound, first = measured, last + round(1.0 / T_s)
        if name == JITTER:
            sound, first = measured, 0
        try:
            x_h = run(predictor, drive.model, settings, drive.x_d, measured)
            peer, own_noise = sound - x_pb, math.nan
            if name == JITTER:
                without = run(predictor, drive.model, settings, drive.x_d, drive.x_meas)
                peer = drive.x_meas - without
                own_noise = rms(measured - without) / rms(peer)
        except SignalError:
            replays.append(FaultyReplay(drive.index, name, math.inf, math.inf, refused=True))
            continue
        ratio = rms((sound - x_h)[first:]) / rms(peer[first:])
        change = float(np.abs(x_h - x_pb).max() / np.abs(sound - x_pb).max())
        replays.append(FaultyReplay(drive.index, name, ratio, change, False, own_noise))
    return replays


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
        print(f"  {r.ratio:.4g} × physics {UM * r.rms_pb:.3g} µm, {r.hold_ratio:.3g} × hold: drive {r.index}")


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


Results = tuple[list[Replay], list[FaultyReplay]]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generator", choices=tuple(GENERATORS), default="modal", help="of the drives")
    parser.add_argument("--seed", type=int, help="the generator's own if left out")
    parser.add_argument("--n", type=int, help="number of drives, 1000 or 250")
    parser.add_argument("--faults", action="store_true", help="with each fault of the sensor too")
    parser.add_argument("--predictor", choices=tuple(PREDICTORS), default="default")
    parser.add_argument("--core", action="store_true", help="the C core instead of the library")
    parser.add_argument("--peers", action="store_true", help="beside ARX models of 20 and 40 lags, too")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    chosen = parser.parse_args(arguments)
    generator = GENERATORS[chosen.generator]
    seed = generator.seed if chosen.seed is None else chosen.seed
    n = generator.n if chosen.n is None else chosen.n
    size = min(generator.chunk, -(-n // chosen.processes))
    groups = [range(i, min(i + size, n)) for i in range(0, n, size)]
    with ProcessPoolExecutor(chosen.processes, get_context("spawn")) as pool:
        x = [one for group in pool.map(partial(generator.true_positions, seed=seed), groups) for one in group]
        chosen.seed = seed
        task = partial(_results, chosen=chosen)
        results = list(pool.map(task, groups, [x[group.start : group.stop] for group in groups]))
    print_replays([replayed for group, _ in results for replayed in group], chosen.predictor)
    if chosen.faults:
        print_faults([replayed for _, group in results for replayed in group])


def _results(indices: range, x: Sequence[Array], *, chosen: argparse.Namespace) -> Results:
    """Return the results of drives whose true positions are known."""
    run = library_replay
    if chosen.core:
        from random_drives.replay import core_replay as run
    drives, predictor = GENERATORS[chosen.generator].drives_at(indices, x, chosen.seed), chosen.predictor
    faulty = (
        [one for drive in drives for one in replay_faults(drive, chosen.seed, predictor, run)] if chosen.faults else []
    )
    return [replay(drive, predictor, run, peers=chosen.peers) for drive in drives], faulty


if __name__ == "__main__":
    main()
