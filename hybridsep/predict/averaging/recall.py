"""Memory of a run for recall: what the physics model missed the last time that it got the same commands.

Most axes repeat: a part program, a pick and place, a test signal. The memory has the commands as they came, and the
residuals. For each lag ``τ`` a sum ``D_τ ← γ D_τ + (Δu(k) − Δu(k−τ))²`` of changes ``Δu`` over some samples follows how
much the commands ahead, and those before them, are like those ``τ`` samples before; it fades in as many as are
predicted. The lag with the least gives the residuals that were measured then. Under a compensator it is the shortest
lag whose sum is small: the modified command of that time is most like the one now. The residuals count by
``1/(1 + (D_τ/S)/ρ²)``, with the same sum ``S`` of the changes themselves, and a tolerance ``ρ``. There a part that came
several times is remembered as a fading mean: with only the last one, what the physics model has wrong would grow.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.signals import Array
from .constants import CONSTANTS

_UPDATES = 25
"""Samples of a window, at most, at which all lags are compared: a controller does it in the samples between them."""

_ALIKE = 1e-100  # square of a change, m², that counts as 0: sums of smaller ones would slow a processor down

PULSE = 14  # samples of a change of the command that answers to it are compared by: what a plan may ask for at once

_ROWS = 3  # of what was measured

_SAME = 1e-5  # distance, relative to the changes', below which stretches under a compensator are the same


@dataclass(frozen=True, eq=False)
class Memory:
    """Commands and what was measured, oldest first; zeros before the first ones."""

    commands: Array  # (n + stride,), m: as they came, as far as they are known, relative to the start
    # (3, n), m, as far as it is measured: residuals of the physics model; commands of the drive, as late as the
    # command's expert takes them; and what these are before x_pb
    measured: Array
    repeats: Array  # (n,): how often each came before, as far as it was alike
    distances: Array  # (n,), m²: ``D_τ`` of the lags n … 1
    moved: float  # m²: ``S``
    n_ahead: int  # commands that are known ahead of those that were predicted

    @classmethod
    def init(cls, n: int, Np: int) -> "Memory":
        """Return a memory of ``n`` samples of a run at rest, for windows of ``Np``."""
        return cls(np.zeros(n + max(1, Np // _UPDATES)), np.zeros((_ROWS, n)), np.zeros(n), np.zeros(n), 0.0, 0)

    def restart(self) -> "Memory":
        """Return the memory at the beginning of another run, at rest at its start, after a sample without residual.

        Commands that were known ahead and never measured are forgotten: each command stands beside its residual.
        """
        n_measured, size = max(len(self.commands) - self.n_ahead, 0), len(self.repeats)
        unknown = np.full(len(self.commands) - n_measured, self.commands[0])
        commands = np.concatenate((unknown, self.commands[:n_measured]))
        end = np.array([[0.0], [commands[-1]], [0.0]])
        measured, repeats = np.hstack((self.measured, end))[:, 1:] - end, np.append(self.repeats, 0.0)[1:]
        return Memory(np.append(commands[1:], commands[-1]) - commands[-1], measured, repeats, np.zeros(size), 0.0, 0)

    def append_commands(self, path: Array, n_known: int | None, Np: int) -> "Memory":
        """Return the memory that knows the first ``n_known`` commands of those to predict, ``(m,)``, m."""
        n, new = len(self.repeats), path[self.n_ahead : n_known]
        stride = len(self.commands) - n
        commands, distances = np.concatenate((self.commands, new)), self.distances.copy()
        gamma, moved, begin = math.exp(-stride / len(path)), self.moved, len(self.commands)
        end = begin + len(new)
        begin = end - Np * (len(new) // Np)  # windows end with the commands; before the first one there is rest
        changes, difference = commands[stride:] - commands[:-stride], np.empty(n)
        for first in range(begin, end, Np):
            for k in range(first - stride, first - stride + Np // stride * stride, stride):
                distances *= gamma
                np.subtract(changes[k], changes[k - n : k], out=difference)
                difference *= difference
                difference += _ALIKE
                distances += difference
                moved = gamma * moved + (float(changes[k]) ** 2 + _ALIKE)
        n_ahead = max(self.n_ahead, len(path[:n_known]))
        return replace(self, commands=commands[len(new) :], distances=distances, moved=moved, n_ahead=n_ahead)

    def found(self, n: int, before: int = 0) -> tuple[int, float]:
        """Return the place of the residuals after the commands most like those ahead, and how they count; or zeros.

        ``n``: samples from the last measured to the last known command; ``before``: if a compensator plans, those that
        are compared before them.
        """
        size, first = len(self.repeats), max(before, 1)
        if size < n + first:
            return 0, 0.0
        compared = np.maximum(self.distances, _SAME * self.moved if before else 0.0)
        place = size - n - int(np.argmin(compared[first : size - n + 1][::-1]))  # the shortest lag of equals
        distance, tolerated = float(self.distances[place]), CONSTANTS.recall_tolerance**2 * self.moved
        return place, tolerated / (tolerated + distance) if distance > 0.0 else 0.0

    def recalled(self, n: int, before: int = 0) -> "Recalled":
        """Return what is :meth:`found`, with the samples ``before`` it, and the last ones."""
        place, alike = self.found(n, before)
        first = max(before, 1)
        if place == 0:
            return Recalled(np.zeros((_ROWS, first + n)), np.zeros((_ROWS, first)), 0.0, 0.0)
        same = _SAME * self.moved / max(float(self.distances[place]), _SAME * self.moved, _ALIKE)
        return Recalled(self.measured[:, place - first : place + n], self.measured[:, -first:], alike, same)

    def remember(self, measured: Array, n: int = 0, before: int = 0) -> "Memory":
        """Return the memory with samples more, ``(3, m)``, m; ``n``, ``before``: behind a compensator, as above."""
        m, (place, alike) = measured.shape[1], self.found(n, before) if before else (0, 0.0)
        then, repeats = (self.measured, alike * (self.repeats + 1.0)) if place else (measured, np.zeros(m))
        then, repeats = then[:, place : place + m], repeats[place : place + m]
        kept = np.where(repeats < CONSTANTS.recall_repeats, 0.0, (1.0 - CONSTANTS.recall_share) * alike)
        measured = np.hstack((self.measured, measured + kept * (then - measured)))[:, m:]
        repeats, n_ahead = np.append(self.repeats, repeats)[m:], max(self.n_ahead - m, 0)
        return replace(self, measured=measured, repeats=repeats, n_ahead=n_ahead)


class Recalled(NamedTuple):
    """What was measured, as in :class:`Memory`."""

    then: Array  # (3, before + n), m: what is recalled
    now: Array  # (3, before), m: the last samples
    alike: float  # how it counts, 0 … 1,
    same: float  # and how far its path is the same, so that commands of the drive differ by what was planned, 0 … 1
