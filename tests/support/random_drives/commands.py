"""Random reference trajectories of a feed axis, sampled at 1 kHz."""

from collections.abc import Callable, Iterator
from itertools import cycle

import numpy as np

from hybridsep.base.settings import Limits
from hybridsep.base.signals import Array
from hybridsep.plants.trajectory import along_path, archimedean_spiral, rest_to_rest
from random_drives.drive import Draws

T_S = 1e-3  # sampling interval, s
V_MAX = 0.2  # largest velocity, m/s
Move = tuple[float, float]  # distance, m, and rest after it, s


def random_command(draws: Draws) -> tuple[str, Array]:
    """Return the kind of a trajectory and its positions, ``(n,)``, m, 6 to 10 s, at rest at first."""
    kind = draws.choice(tuple(KINDS))
    n = draws.whole(6000, 10000)
    start = draws.uniform(-0.5, 0.5) if draws.chance(0.4) else 0.0
    rest = round(draws.uniform(0.0, 1.0 if kind == "dwells" else 0.3) / T_S)
    x_d = np.zeros(n)
    moved = KINDS[kind](draws, n - rest)
    x_d[rest : rest + len(moved)] = moved[: n - rest]
    x_d[rest + len(moved) :] = moved[-1]
    return kind, start + x_d


def _stroke(draws: Draws, longest: float = 0.1) -> float:
    return draws.log_uniform(0.001, longest)


def _limits(draws: Draws, stroke: float) -> Limits:
    """Return limits under which a stroke, m, takes no longer than about a second and a half."""
    velocity = draws.log_uniform(max(0.01, stroke / 1.5), V_MAX)
    acceleration = draws.log_uniform(0.3, 8.0)
    return Limits(velocity, acceleration, acceleration / draws.log_uniform(0.005, 0.06))


def _moves(moves: Iterator[Move], limits: Limits, n: int) -> Array:
    """Return jerk-limited moves from 0, each followed by a rest, until there are ``n`` samples."""
    parts, length, here = [np.zeros(1)], 1, 0.0
    known: dict[Move, Array] = {}
    while length < n:
        move = next(moves)
        if move not in known:
            known[move] = rest_to_rest([0.0, move[0]], limits, T_S, dwell=move[1])[1:]
        parts.append(here + known[move])
        length, here = length + len(known[move]), here + move[0]
    return np.concatenate(parts)


def _staircase(draws: Draws, n: int) -> Array:
    """Return equal steps up, then down, with equal rests."""
    stroke, steps = _stroke(draws, 0.03), draws.whole(1, 6)
    rest = draws.uniform(0.05, 1.0)
    sign = draws.sign()
    moves = [(one * sign * stroke, rest) for one in (1, -1) for _ in range(steps)]
    return _moves(cycle(moves), _limits(draws, stroke), n)


def _cycles(draws: Draws, n: int) -> Array:
    """Return a work cycle, over and over: there in a few moves, back in one."""
    stroke = _stroke(draws)
    there = [
        (draws.sign() * stroke * draws.uniform(0.2, 1.0), draws.uniform(0.0, 0.4)) for _ in range(draws.whole(1, 4))
    ]
    back = (-sum(distance for distance, _ in there), draws.uniform(0.0, 0.4))
    return _moves(cycle([*there, back]), _limits(draws, stroke), n)


def _random_moves(draws: Draws, n: int) -> Array:
    """Return moves that do not repeat, with random rests, about a position."""
    stroke = _stroke(draws)

    def moves() -> Iterator[Move]:
        here = 0.0
        while True:
            distance = draws.sign() * draws.log_uniform(0.02, 1.0) * stroke
            if abs(here + distance) > stroke:
                distance = -distance
            here += distance
            yield distance, draws.uniform(0.0, 0.4)

    return _moves(moves(), _limits(draws, stroke), n)


def _dwells(draws: Draws, n: int) -> Array:
    """Return few moves with long rests."""
    stroke = _stroke(draws)

    def moves() -> Iterator[Move]:
        sign = draws.sign()
        while True:
            yield sign * stroke * draws.uniform(0.3, 1.0), draws.uniform(0.8, 3.0)
            sign = -sign if draws.chance(0.7) else sign

    return _moves(moves(), _limits(draws, stroke), n)


def _spiral(draws: Draws, n: int) -> Array:
    """Return one coordinate of a spiral from its centre, some followed by the way back."""
    radius = _stroke(draws, 0.05)
    velocity = draws.log_uniform(max(0.01, radius), V_MAX)
    acceleration = draws.log_uniform(0.3, 8.0)
    limits = Limits(velocity, acceleration, acceleration / draws.log_uniform(0.005, 0.06))
    # The arc is about π·radius·turns long.
    turns = float(np.clip(velocity * draws.uniform(0.4, 1.0) * n * T_S / (np.pi * radius), 1.0, 20.0))
    out = along_path(*archimedean_spiral(radius, turns), limits, T_S)[:, draws.whole(0, 1)]
    return np.concatenate((out, out[::-1])) if draws.chance(0.5) else out


def _sweep(draws: Draws, n: int) -> Array:
    """Return a sine of rising or falling frequency within limits of velocity and acceleration, faded in."""
    amplitude = _stroke(draws) / 2
    velocity, acceleration = draws.log_uniform(0.01, V_MAX), draws.log_uniform(0.3, 8.0)
    slow, fast = draws.log_uniform(0.2, 1.0), draws.log_uniform(2.0, 30.0)
    t = np.arange(n) * T_S
    part = t / t[-1]
    if draws.chance(0.3):
        part = 1 - part
    omega = 2 * np.pi * slow * (fast / slow) ** part
    phase = np.cumsum(omega) * T_S
    fade = np.sin(np.pi / 2 * np.minimum(t / 0.3, 1.0)) ** 2
    within = np.minimum(np.minimum(amplitude, velocity / omega), acceleration / omega**2)
    return np.asarray(fade * within * np.sin(phase))


KINDS: dict[str, Callable[[Draws, int], Array]] = {
    "staircase": _staircase,
    "spiral": _spiral,
    "cycles": _cycles,
    "sweep": _sweep,
    "random moves": _random_moves,
    "dwells": _dwells,
}
