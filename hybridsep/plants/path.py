"""Planar paths, commanded positions of X and Y: from a G-code program, or from columns that were recorded.

A planar position is a complex number, X + iY. A program is run in exact stop mode: each move begins and ends at rest,
so that no acceleration jumps; lines that go straight on and arcs of one circle are one move, at one feed. Limits are
along the path: on an arc the acceleration towards its centre and the one along it have √½ of the limit each, and the
jerk of its turning, v³/r², is limited, too.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import LogError
from ..base.settings import Limits, samples_before
from ..base.signals import Array
from .trajectory import read_trajectory, rest_to_rest

Points = NDArray[np.complexfloating[Any, Any]]  # planar positions, ``(n,)``, m: X + iY

_PROGRAM = re.compile(r"(?:\s|\([^)]*\)|[;%][^\n]*)*/?[GMNOFST]\d", re.IGNORECASE)
"""Begin of a program: comments, then a word; a table begins with numbers or names."""

_COMMENT = re.compile(r"\([^)]*\)|;.*|%|^\s*/")
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*")

_WITHOUT_EFFECT = {17.0, 40.0, 43.0, 49.0, 54.0, 61.0, 61.1, 64.0, 80.0, 91.1, 94.0, 97.0}
"""G words that leave a planar path as it is: its plane, no offsets but the tool's length, path modes, units of F."""

_IGNORED = frozenset("GMNOSTZHD")  # letters of words that are not read; Z moves do not change the path in the plane

_ROUNDED = 5e-6  # distance up to which the two radii of an arc, or two centres, are the same one rounded, m


@dataclass(frozen=True)
class PlanarPath:
    """Commanded positions of two axes."""

    points: Points  # (n,) complex, m: X + iY at ``k·T_s``
    cutting: NDArray[np.bool_]  # (n,): whether a sample is of a move at a feed, no rapid one
    centre: Points  # (n,) complex, m: centre of the full circle that a sample is on; NaN elsewhere

    @classmethod
    def of(cls, points: Points) -> "PlanarPath":
        """Return a path of which nothing but its positions is known."""
        return cls(points, np.ones(len(points), dtype=np.bool_), np.full(len(points), complex(np.nan)))

    @property
    def axes(self) -> tuple[Array, Array]:
        """Commands of X and Y, ``(n,)``, m."""
        return np.array(self.points.real, dtype=np.float64), np.array(self.points.imag, dtype=np.float64)


@dataclass(frozen=True)
class _Move:
    """A line, an arc about ``centre`` by ``sweep``, or a rest."""

    begin: complex  # m, X + iY, as the end and the centre
    end: complex
    feed: float = inf  # m/s
    centre: complex | None = None  # of an arc
    sweep: float = 0.0  # rad
    rest: float = 0.0  # s

    def joined(self, after: "_Move") -> "_Move | None":
        """Return this move and the one after as one, if they are; otherwise None."""
        if self.feed != after.feed or self.rest or after.rest:
            return None
        if self.centre is None and after.centre is None:
            turn = (after.end - after.begin) / (self.end - self.begin)
            return replace(self, end=after.end) if abs(turn.imag) < 1e-6 * turn.real else None
        if self.centre is None or after.centre is None or self.sweep * after.sweep < 0.0:
            return None
        same = abs(self.centre - after.centre) < _ROUNDED
        return replace(self, end=after.end, sweep=self.sweep + after.sweep) if same else None

    def points(self, limits: Limits, T_s: float) -> Points:
        """Return the positions after the first, sampled at ``T_s``."""
        if self.rest:
            return np.full(samples_before(self.rest, T_s), self.end)
        if self.centre is None:
            share = _shares(abs(self.end - self.begin), self.feed, limits, T_s)
            return np.asarray(self.begin + share * (self.end - self.begin))
        begin, end = self.begin - self.centre, self.end - self.centre
        radius = abs(begin)
        fastest = min((limits.acceleration * np.sqrt(0.5) * radius) ** 0.5, (limits.jerk * radius**2) ** (1 / 3))
        tangential = replace(limits, acceleration=limits.acceleration * float(np.sqrt(0.5)))
        share = _shares(radius * abs(self.sweep), min(self.feed, fastest), tangential, T_s)
        turned = begin * np.exp(1j * self.sweep * share)
        return np.asarray(self.centre + (1.0 + share * (abs(end) / radius - 1.0)) * turned)


def _shares(length: float, feed: float, limits: Limits, T_s: float) -> Array:
    """Return how much of a move from rest to rest is done at each sample after the first, 0 … 1."""
    s = rest_to_rest([0.0, length], replace(limits, velocity=min(feed, limits.velocity)), T_s)
    return np.minimum(s[1:] / length, 1.0)


def read_path(path: str | Path, limits: Limits, T_s: float, unit: str | None = None) -> PlanarPath:
    """Read a planar path: a G-code program, or a log's columns ``x`` and ``y`` of commanded positions.

    ``path``: a program in G17 with G0 to G3 (I and J from the arc's beginning, or R), G4 (P in s), G20, G21, G90, G91
    and F (a minute), from X0 Y0 on; comments, N, M, S and T words and Z moves are passed over. Or a log in any format
    of :func:`~hybridsep.logs.log.read_log`, whose times, if there are any, must be ``T_s`` apart; ``limits``: of the
    motion along the path of a program; ``T_s``: sampling interval, s; ``unit``: unit of a log's columns; from their
    names, or m, if left out. LogError if a word would change the path and is not read, with its line; or if a log
    cannot be used.
    """
    with Path(path).open("rb") as file:
        beginning = file.read(4096).decode("latin-1")
    if not _PROGRAM.match(beginning):
        x, y = (read_trajectory(path, column=name, unit=unit, T_s=T_s)[0] for name in ("x", "y"))
        return PlanarPath.of(x + 1j * y)
    moves: list[_Move] = []
    for move in _moves(Path(path)):
        joined = moves[-1].joined(move) if moves else None
        moves[-1:] = [joined] if joined else [*moves[-1:], move]
    if not any(move.feed < inf for move in moves):
        raise LogError(f"{Path(path).name} has no move in X or Y at a feed: G1, G2, G3 with a coordinate that changes")
    pieces = [move.points(limits, T_s) for move in moves]
    sizes = [1, *map(len, pieces)]
    full = [move.centre if abs(move.sweep) > 2 * np.pi - 1e-6 else None for move in moves]
    return PlanarPath(
        np.concatenate([[moves[0].begin], *pieces]),
        np.repeat([False, *(move.feed < inf for move in moves)], sizes),
        np.repeat([complex(np.nan if one is None else one) for one in (None, *full)], sizes),
    )


def _moves(path: Path) -> Iterator[_Move]:
    """Yield the moves of a program, block by block."""
    here, motion, feed, metres, absolute = 0j, 0.0, 0.0, 1e-3, True
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        where, text = f"{path.name}, line {number}", _COMMENT.sub("", line).upper().strip()
        words = [(letter, float(value)) for letter, value in _WORD.findall(text)]
        if unread := _WORD.sub("", text):
            raise LogError(
                f"{where}: words are a letter and a number, got {unread[:40]!r}; expressions, variables and "
                "subprograms are not read: write the moves out, or record the commands as columns x and y"
            )
        codes = [value for letter, value in words if letter == "G"]
        arguments = {letter: value for letter, value in words if letter not in _IGNORED}
        for code in codes:
            if code in (0.0, 1.0, 2.0, 3.0):
                motion = code
            elif code in (20.0, 21.0):
                metres = 0.0254 if code == 20.0 else 1e-3
            elif code in (90.0, 91.0):
                absolute = code == 90.0
            elif code != 4.0 and code not in _WITHOUT_EFFECT:
                raise LogError(f"{where}: G{code:g} is not read; G0 to G4, G17, G20, G21, G90 and G91 are")
        known = "P" if 4.0 in codes else f"XYF{'IJR' * (motion >= 2.0)}{'P' * (64.0 in codes)}"
        calls = [f"M{value:g}" for letter, value in words if letter == "M" and value in (98.0, 99.0)]
        if strange := sorted(set(arguments) - set(known)) + calls:
            raise LogError(f"{where}: {', '.join(strange)} is not read here, and may change the path; take it out")
        feed = metres * arguments["F"] / 60.0 if "F" in arguments else feed
        if 4.0 in codes:
            yield _Move(here, here, rest=arguments.get("P", 0.0))
        begin = {"X": here.real, "Y": here.imag}
        origin = dict.fromkeys(begin, 0.0) if absolute else begin
        x, y = (origin[a] + metres * arguments[a] if a in arguments else begin[a] for a in begin)
        there = complex(x, y)
        if motion >= 1.0 and not feed > 0.0 and set(arguments) & set("XYIJR"):
            raise LogError(f"{where}: G{motion:g} needs a feed above 0; give F in it or before")
        if motion >= 2.0 and set(arguments) & set("XYIJR"):
            lengths = {letter: metres * value for letter, value in arguments.items()}
            yield _arc(where, here, there, feed, 1 if motion == 3.0 else -1, lengths)
        elif there != here:
            yield _Move(here, there, feed if motion else inf)
        here = there
        if any(letter == "M" and value in (2.0, 30.0) for letter, value in words):
            return


def _arc(where: str, begin: complex, end: complex, feed: float, sense: int, given: Mapping[str, float]) -> _Move:
    """Return an arc, counter-clockwise if ``sense`` is 1, clockwise if it is −1; lengths are in m."""
    if "R" in given:
        chord, radius = end - begin, given["R"]
        height = radius**2 - abs(chord) ** 2 / 4
        if chord == 0 or height < -_ROUNDED * abs(radius):
            raise LogError(f"{where}: no arc of R{1e3 * radius:g} mm leads over {1e3 * abs(chord):g} mm; give I and J")
        side = 1j * sense * np.sign(radius) * max(height, 0.0) ** 0.5
        centre = begin + chord / 2 + side * chord / abs(chord)
    else:
        centre = begin + complex(given.get("I", 0.0), given.get("J", 0.0))
    radii = abs(begin - centre), abs(end - centre)
    if min(radii) == 0.0 or abs(radii[0] - radii[1]) > max(_ROUNDED, 1e-3 * radii[0]):
        raise LogError(
            f"{where}: an arc's ends must be as far from its centre, got {1e3 * radii[0]:g} and {1e3 * radii[1]:g} mm; "
            "I and J are from the arc's beginning"
        )
    sweep = float(np.angle((end - centre) / (begin - centre)) * sense % (2 * np.pi))
    return _Move(begin, end, feed, complex(centre), sense * (sweep if sweep > 1e-6 else 2 * np.pi))
