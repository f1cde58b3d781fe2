"""Reference trajectories: rest-to-rest moves, planar paths and the paper's two test trajectories.

Every function returns positions in metres, sampled exactly at ``k·T_s``; jerk-limited, time-optimal moves come from
ruckig (Berscheid and Kröger, RSS 2021).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import ParameterError, SignalError, check_kind
from ..base.parameters import finite
from ..base.settings import Limits, check, samples_before
from ..base.signals import Array, as_samples
from ..logs.log import read_log

if TYPE_CHECKING:
    import ruckig

_Curve = Callable[[Array], Array]

SAMPLES_MAX = 2_000_000  # largest number of samples of a generated trajectory: over half an hour at 1 kHz

PAPER_LIMITS = Limits(velocity=0.08, acceleration=8.0, jerk=1000.0)  # eq. (14)


def rest_to_rest(
    positions: ArrayLike,
    limits: Limits,
    T_s: float = 1e-3,
    *,
    start_times: Sequence[float] | None = None,
    dwell: float = 0.0,
    duration: float | None = None,
) -> Array:
    """Return a sequence of time-optimal, jerk-limited rest-to-rest moves, ``(n,)``, m.

    The samples are at ``0, T_s, …``, the last one at or after the end.

    Parameters
    ----------
    positions : (m + 1,) array_like, m
        Initial position, then the target of each of the ``m`` moves.
    limits : Limits
        Velocity, acceleration and jerk limits.
    T_s : float
        Sampling interval, s.
    start_times : sequence of m floats, optional
        Start time of each move, s; by default ``dwell`` after the end of the one before.
    dwell : float
        Rest between moves, s, when no start times are given.
    duration : float, optional
        Duration, s; to the end of the last move and its dwell if left out.

    Raises
    ------
    ParameterError
        If a move starts before the one before has ended, the times do not fit, or it would have more than
        :data:`SAMPLES_MAX` samples.
    SignalError
        If ``positions`` has less than one move or is not finite, or ``start_times`` are not as many as the moves.
    """
    T_s = check("T_s", T_s)
    points = as_samples(positions, "positions")
    if len(points) < 2:
        raise SignalError(f"positions must hold the start and at least one target, got {len(points)} values")
    times = None if start_times is None else as_samples(start_times, "start_times", len(points) - 1).tolist()
    dwell, moves, begin = finite(dwell, "dwell", least=0.0), [], 0.0
    for i, (here, there) in enumerate(pairwise(points.tolist())):
        start = begin if times is None else times[i]
        if start < begin - 1e-6 * T_s:
            raise ParameterError(f"move {i + 1} starts at {start:g} s, before the one before has ended at {begin:g} s")
        move = _plan(here, there, limits)
        moves.append((start, move))
        begin = start + move.duration + (dwell if times is None else 0.0)
    end = begin if duration is None else finite(duration, "duration")
    if end < begin - 1e-6 * T_s:
        raise ParameterError(f"duration is {end:g} s, but the moves need {begin:g} s")
    if not end / T_s < SAMPLES_MAX:
        raise ParameterError(
            f"a trajectory must have fewer than {SAMPLES_MAX} samples, got {end:g} s at T_s = {T_s:g} s; "
            "raise its limits or T_s"
        )
    n = samples_before(end, T_s) + 1
    x_d = np.full(n, points[0])
    for start, move in moves:
        first = samples_before(start, T_s)
        t = np.arange(first, n) * T_s - start
        moving = t[t < move.duration].tolist()
        x_d[first:] = move.at_time(move.duration)[0][0]
        x_d[first : first + len(moving)] = [move.at_time(max(one, 0.0))[0][0] for one in moving]
    return x_d


def staircase(T_s: float = 1e-3, *, limits: Limits = PAPER_LIMITS) -> Array:
    """Return the paper's staircase: a 10 mm move at the start of every second, three up, three down, 6 s, ``(n,)``, m.

    It has 6001 samples at 1 ms; each move takes 0.143 s under eq. (14), and ParameterError is raised if one would take
    more than a second.
    """
    return rest_to_rest(np.array([0.0, 1, 2, 3, 2, 1, 0]) * 0.010, limits, T_s, start_times=range(6), duration=6.0)


def spiral(
    T_s: float = 1e-3, *, radius: float = 0.030, turns: float = 5.0, limits: Limits = PAPER_LIMITS
) -> tuple[Array, Array]:
    """Return the commands of X and Y for the paper's spiral from the centre, 5 turns, 30 mm, eq. (14) along the path.

    Each is ``(n,)``, m, 5.9 s at the default values.
    """
    position, derivative, end = archimedean_spiral(radius, turns)
    points = along_path(position, derivative, end, limits, T_s)
    return np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])


def read_trajectory(
    path: str | Path, *, column: str = "x_d", unit: str | None = None, T_s: float | None = None
) -> tuple[Array, float]:
    """Return a commanded position, (n,), m, or rad where the unit is an angle, and its sampling interval, s, of a file.

    ``column`` is the command's name there; ``unit`` and ``T_s`` are as of :func:`hybridsep.logs.log.read_log`, which
    reads it.

    LogError if the file, the column or the time axis cannot be used.
    """
    log = read_log(path, columns={"x_d": column, "x": column}, unit=unit, T_s=T_s)
    return log.x_d, log.T_s


def archimedean_spiral(radius: float, turns: float) -> tuple[_Curve, _Curve, float]:
    """Return ``r = radius · θ / θ_end`` as position, derivative and end parameter for :func:`along_path`."""
    end = 2 * np.pi * finite(turns, "turns", above=0.0)
    pitch = finite(radius, "radius", above=0.0) / end

    def position(theta: Array) -> Array:
        return pitch * np.stack((theta * np.cos(theta), theta * np.sin(theta)), axis=-1)

    def derivative(theta: Array) -> Array:
        return pitch * np.stack((np.cos(theta) - theta * np.sin(theta), np.sin(theta) + theta * np.cos(theta)), axis=-1)

    return position, derivative, end


def along_path(position: _Curve, derivative: _Curve, end: float, limits: Limits, T_s: float = 1e-3) -> Array:
    """Return a rest-to-rest motion along a planar path, with limits along the arc, ``(n, d)``, m, at ``k·T_s``.

    ``position`` and ``derivative``, (n,) → (n, d), m, are the path and its derivative over a parameter from 0 to
    ``end`` > 0; the derivative is never zero inside. The arc length is inverted to 1e-12 of the total.
    """
    nodes = np.linspace(0.0, end, 2001)  # between panels, over which the length is integrated
    arc = np.concatenate(([0.0], np.cumsum(_panel_lengths(derivative, nodes[:-1], nodes[1:]))))  # up to each node
    s = rest_to_rest([0.0, arc[-1]], limits, T_s)
    u = np.interp(s, arc, nodes)
    # Newton iteration on s(u) = s_k, with Gauss-Legendre quadrature from the panel's left end.
    panel = np.clip(np.searchsorted(arc, s, "right") - 1, 0, len(nodes) - 2)
    for _ in range(8):
        miss = arc[panel] + _panel_lengths(derivative, nodes[panel], u) - s
        u = np.clip(u - miss / np.maximum(_speed(derivative, u), 1e-300), 0.0, end)
        if np.max(np.abs(miss)) <= 1e-13 * arc[-1]:
            break
    return position(u)


def _plan(here: float, there: float, limits: Limits) -> "ruckig.Trajectory":
    """Return ruckig's time-optimal move between two points at rest."""
    import ruckig

    check_kind(Limits, limits=limits)
    request = ruckig.InputParameter(1)
    request.current_position, request.target_position = [here], [there]
    request.max_velocity, request.max_acceleration = [limits.velocity], [limits.acceleration]
    request.max_jerk = [limits.jerk]
    move = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(request, move)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ParameterError(f"no move from {here:g} m to {there:g} m under {limits}: {result}")
    return move


def _speed(derivative: _Curve, u: Array) -> Array:
    return np.asarray(np.linalg.norm(derivative(u), axis=-1))


def _panel_lengths(derivative: _Curve, left: Array, right: Array) -> Array:
    """Return ``∫ |dr/du| du`` over each panel ``[left, right]``, Gauss-Legendre of order 8."""
    x, w = np.polynomial.legendre.leggauss(8)
    half = (right - left) / 2
    u = ((left + right) / 2)[:, None] + half[:, None] * x
    return np.asarray(half * (_speed(derivative, u.ravel()).reshape(u.shape) @ w))
