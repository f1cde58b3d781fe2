"""Closed loops of a compensator with random parameters, in any implementation, each with a drive of its own."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from c_core import TS
from stream import OUTPUTS, Array, Stream, kind_of, machine_of

from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest

LIMITS = (0.08, 8.0, 1000.0), (0.1, 16.0, 5000.0)  # v_max, a_max, j_max: the trajectory's bound most plans; the usual


@dataclass(frozen=True)
class RandomLoop:
    """One closed loop."""

    values: dict[str, Any]  # parameters of the compensator
    r: Array  # (n,), m: commanded positions, as they enter the look-ahead; they begin at the position of rest
    noise_seed: int  # of the encoder
    quantum: float = 0.0  # m: of the encoder and of the commands; 0: none

    def rounded(self, x: Any) -> Any:
        """Return positions, m, as numbers of quanta."""
        return self.quantum * np.round(x / self.quantum) if self.quantum else x

    def at_rest_at(self, start: float, n_rest: int) -> "RandomLoop":
        """Return the same loop in micrometres, from another position, m, where it rests for ``n_rest`` samples."""
        loop = replace(self, quantum=1e-6)
        r = loop.rounded(self.r - self.r[0] + start)
        return replace(loop, r=np.concatenate((np.full(n_rest, r[0]), r))[: len(r)])


def random_loop(seed: int, n: int, **fixed: float) -> RandomLoop:
    """Return a loop whose parameters follow from a seed, but for those that are fixed."""
    rng = np.random.default_rng(seed)
    rng.integers(3)
    Np = int(rng.choice([20, 24, 30, 40, 50, 60, 80, 100]))
    spacing = int(rng.choice([s for s in (1, 2, 3, 4, 5, 8, 10) if Np % s == 0]))
    least = Np + 4 * spacing + 3
    values: dict[str, Any] = {
        "Np": Np,
        "spacing": spacing,
        "preview": int(rng.integers(least, max(least + 1, 260))),
        "p": int(rng.integers(1, min(Np, 60) + 1)),
        "q": int(rng.integers(0, min(Np, 45))),
        "lambda": float(10 ** rng.uniform(-12, -6)),
    }
    one = int(rng.integers(3))
    chosen = LIMITS[one] if one < 2 else (np.array(LIMITS[0]) * rng.uniform(1, 3, 3)).tolist()
    values |= dict(zip(("v_max", "a_max", "j_max"), chosen, strict=True)) | {
        "change_max": float(rng.choice([1e-4, 2e-4, 5e-4, 1e-3, 5e-3])),
        "jerk_weight": float(10 ** rng.uniform(-2, 2.5)),
        "no_reversal": int(rng.integers(2)),
        "t_init": float(rng.choice([0.0, 0.05, 0.1, 0.3])),
    }
    stops = np.cumsum(np.concatenate(([0.0], rng.uniform(-0.01, 0.01, 30))))
    r = rest_to_rest(stops, PAPER_LIMITS, TS, dwell=float(rng.uniform(0, 0.3)))[:n]
    if part := int(fixed.get("recall", 0)) // 4:  # a memory has two of the way there and back, which is repeated
        r = np.resize(np.concatenate((r[:part], r[part - 1 :: -1])), n)
    r = r + float(rng.choice([0.0, 0.1]))
    return RandomLoop({"averaging": 0, "horizon": 0, **values, **fixed}, r, int(rng.integers(1000)))


def run(stream: Stream, loop: RandomLoop, *, nudged: bool = False) -> tuple[Array, Array]:
    """Return ``x_dm``, m, and ``sep_state`` of every sample, ``(n,)`` both."""
    # Where the loop is nudged, the last binary place of each measured position is one more
    machine, start = machine_of(stream.model), float(loop.r[0])
    assert machine.plant is not None
    plant, encoder = machine.new_plant(), Encoder(machine.plant.noise_std, loop.noise_seed)
    plant.reset(start)
    stream.initialise({**loop.values, "x_d_ahead": start, "x_meas": start})
    shown = [OUTPUTS[kind_of(stream.model)].index(name) for name in ("x_dm", "sep_state")]
    found = np.empty((2, len(loop.r)))
    for k, ahead in enumerate(loop.r.tolist()):
        outputs, x = stream.outputs(), loop.rounded(encoder.measure(plant.x))
        found[:, k] = [outputs[i] for i in shown]
        plant.step(outputs[shown[0]], TS)
        stream.set("x_d_ahead", ahead)
        stream.set("x_meas", float(np.nextafter(x, np.inf if nudged else x)))
        stream.step(k * TS, TS)
    return found[0], found[1]
