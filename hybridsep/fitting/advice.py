"""Replay of a report, and the advice that follows from it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.metrics import rms_ratio
from ..evaluate.peers import ARX_LAGS, FROZEN, LAG_HOLD, STATE_SPACE
from ..evaluate.verdict import ALIKE, STANDSTILL, WINDOWS_ENOUGH, WINDOWS_MIN, counted
from ..identify.operation import LITTLE_MOTION
from ..logs.controller import Controller
from ..logs.log import Log
from ..logs.units import DisplayUnits
from .replay import Replay

_IN_WORDS = {"physics model": "the physics model alone", "hold": "holding the last residual"}
"""Names of what a hybrid is compared with, in a sentence; others are as they are."""

OF_ITSELF = "What the controller says of itself"  # heading of :meth:`Judged.of_the_controller`

_KNOWN = "Nothing is tested: the saved predictor was trained with this log, and knows it; replay another log."


@dataclass(frozen=True)
class Judged:
    """Replay as it is reported."""

    replay: Replay
    T_s: float  # sampling interval, s
    shown: DisplayUnits  # units in which positions are shown
    part: str  # what the test is on, such as "the log's second half"
    share: float = 1.0  # share of a log's samples that are test samples
    # that the residual repeats with the position, and the option that says so, in words; empty where it does not
    period: str = ""
    unidentified: bool = False  # whether the log's first half had too little motion to identify the axis from
    known: bool = False  # whether the predictor had been trained with the log
    warm: bool = False  # whether it had been trained with another, which no peer had
    # what the controller says of itself; None where the logs have none of its signals
    controller: Controller | None = None

    @cached_property
    def unit(self) -> tuple[float, str]:
        """Factor and name of the unit in which errors are shown."""
        return self.shown.error(self.replay.rms()[0])

    def of_the_controller(self) -> list[str]:
        """Return what the controller says of itself, in words; none where it says nothing."""
        return self.controller.lines(self.shown, self.replay.Np) if self.controller else []

    def figures(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of a table of the errors over the test samples."""
        scale, unit = self.unit
        scored = self.replay.scored()
        rows = []
        for one in scored:
            size = np.abs(one.errors[~np.isnan(one.errors)])
            if one.diverged or not size.size:
                rows.append([one.name, "diverged" if one.diverged else "–", "", "", ""])
                continue
            sizes = (f"{scale * figure:.4g}" for figure in (one.rms, np.quantile(size, 0.95), size.max()))
            ratio = rms_ratio(one.rms, scored[0].rms, self.replay.least)
            rows.append([one.name, *sizes, "–" if math.isnan(ratio) else f"{ratio:.3f}"])
        return ["prediction by", f"RMS [{unit}]", "95 % below", "largest", "× physics"], rows


def whole_log_words(*, warm: bool, known: bool) -> str:
    """Return what a replay of a whole log is tested on, in words: more samples than a fit is, or none."""
    if known:
        return _KNOWN
    began = "began with what an earlier run had learned" if warm else "began without any knowledge"
    return (
        f"The predictor {began}, and the whole log is the test; hybridsep fit tests only on the second half, "
        "after learning the first."
    )


def settling_words(replayed: Replay) -> str:
    """Return which windows of a log with gaps are no test windows, in words; empty where all are."""
    if not any(one.judges_from > one.n_train for one in replayed.recordings):
        return ""
    return " The window after a gap is no test window: no model knows the state of the axis there."


def advice_on(judged: Judged) -> str:
    """Return what to do, in words; with caution where there are few test windows.

    The hybrid is recommended where it is better than each of physics model, hold and peers.
    """
    if judged.known:
        return _KNOWN
    n = judged.replay.verdict().n_windows
    if n < WINDOWS_MIN:
        of = f"{judged.part} has {counted(n)} of {judged.replay.Np} samples"
        return f"Nothing could be judged: {of}; {_enough(judged)}."
    if np.ptp(judged.replay.commands()) == 0.0:
        return f"Nothing was tested: the commanded position does not move in {judged.part}; record moves to its end."
    *others, hybrid = judged.replay.scored()
    best = judged.replay.best()
    if best.rms == 0.0:
        return f"There is no error to predict in {judged.part}: record the axis while it works."
    peer = _IN_WORDS.get(best.name, best.name)
    if best.rms < judged.replay.least:
        return f"There is nothing to gain in {judged.part}: the log's resolution does not show the error of {peer}."
    ratio, the = hybrid.rms / best.rms, "the hybrid (the only one that began trained)" if judged.warm else "the hybrid"
    if n < WINDOWS_ENOUGH or judged.unidentified:
        how = "better than" if ratio < 1.0 - ALIKE else "worse than" if ratio > 1.0 + ALIKE else "as good as"
        but = f"but judged by {counted(n)} only: {_enough(judged)}"
        if judged.unidentified:
            but = (
                "but the first half has too little motion to learn the axis from, for the physics model and for the "
                "others: record moves in both halves"
            )
        return f"So far {the} is {how} {peer}, {ratio:.2f} × its error, {but}."
    by = f"judged by {counted(n)}"
    if ratio < 1.0 - ALIKE:
        return f"Use {the}: its error is {ratio:.2f} × the error of {peer}, the best of the others, {by}."
    if ratio <= 1.0 + ALIKE:
        return f"{the.capitalize()} is neither better nor worse here: {ratio:.2f} × the error of {peer}, {by}."
    plain = min(others[:2], key=lambda one: one.rms)  # physics model and hold, which need no other model
    against = hybrid.rms / plain.rms
    if best.name == plain.name or against >= 1.0 - ALIKE:
        return (
            f"Do not use {the} on what this log shows: {ratio:.2f} × the error of {peer}, which is best, {by}"
            f"{_more_motion(judged)}.{_what_would_help(judged)}"
        )
    return (
        f"Best on what this log shows is {peer}: {the} has {ratio:.2f} × its error, {against:.2f} × the error of "
        f"{_IN_WORDS[plain.name]}, {by}{_more_motion(judged)}.{_what_would_help(judged)}"
    )


def _enough(judged: Judged) -> str:
    """Return how long a recording would do, in words: its test windows, and one before them."""
    seconds = (WINDOWS_ENOUGH + 1) * judged.replay.Np * judged.T_s / judged.share
    return f"record at least {math.ceil(round(10 * seconds, 6)) / 10:g} s"


def _more_motion(judged: Judged) -> str:
    """Return that more motion is to be recorded, in words; empty where the axis moves enough to learn from."""
    steps = [np.abs(np.diff(one.x_d)) for one in judged.replay.recordings]
    fastest = max(float(one.max(initial=0.0)) for one in steps)
    moving = sum(int((one > STANDSTILL * fastest).sum()) for one in steps) / sum(len(one) for one in steps)
    words = f"; the axis moves in {100 * moving:.2g} % of the samples: record more motion"
    return words if moving < LITTLE_MOTION else ""


def _what_would_help(judged: Judged) -> str:
    """Return what would make the hybrid better than the others, as far as the replay shows it; empty without any."""
    replay, hints = judged.replay, []
    names = [one.name for one in replay.scored()]
    for n in (replay.Np // 2, replay.Np // 4, replay.Np // 10):
        *others, hybrid = replay.rms_within(n) if n else [math.nan, math.nan]
        best = int(np.argmin(others))
        if hybrid < (1.0 - ALIKE) * others[best]:
            peer = _IN_WORDS.get(names[best], names[best])
            hints.append(
                f"a smaller look-ahead: over the first {n} of {replay.Np} samples of the windows it has "
                f"{hybrid / others[best]:.2f} × the error of {peer} (--Np {n})"
            )
            break
    if judged.period:
        hints.append(judged.period)
    return f" What may help: {'; '.join(hints)}." if hints else ""


def peers_in_words(judged: Judged) -> str:
    """Return what the peers of a replay are, in words."""
    names = {peer.name for peer in judged.replay.peers}
    words = ["Hold: physics model plus its residual at the last sample measured before the window"]
    if LAG_HOLD in names:
        words.append(f"{LAG_HOLD}: the same on a first-order lag with dead time fitted to the first half")
    if STATE_SPACE in names:
        words.append(f"{STATE_SPACE}: subspace identification of the first half, order 1 to 8, and its Kalman filter")
    frozen = any(peer.way == FROZEN for peer in judged.replay.peers)
    ways = "frozen after the first half or " if frozen else ""
    words.append(
        f"ARX: black-box models of {' and '.join(str(n) for n in ARX_LAGS)} lags of x − x_d and of the command's "
        f"increments by least squares, {ways}refitted before each window to all samples so far"
    )
    if judged.replay.offset:
        words.append("the physics model is judged with the offset identified beside it; the FMU's x_pb has none")
    return "; ".join(words) + "."


def extent(logs: Sequence[Log]) -> str:
    """Return how many samples logs of one sampling interval have, over what time and at what rate.

    Where measurements are missing or were cut out, or samples left out, the share of the files' samples and their own
    rate are said as well.
    """
    T_s, n, own = logs[0].T_s, sum(len(log.t) for log in logs), logs[0].T_recorded
    n_used = sum(int(np.count_nonzero(~np.isnan(log.x_meas))) for log in logs)
    n_recorded = sum(log.n_recorded or len(log.t) for log in logs)
    words = f"{n} samples"
    if n_used < 0.995 * n_recorded:  # else the file counts as used, all of it
        words = f"{n_used} of {n_recorded} samples ({100 * n_used / n_recorded:.3g} %)"
    words += f", {n * T_s:.4g} s at {1 / T_s:.4g} Hz"
    if own and abs(T_s / own - 1.0) > 0.01:  # else both rates are one
        words += f" (recorded at {1 / own:.4g} Hz)"
    segments = sum(len(log.starts) for log in logs)
    if segments == len(logs):
        return words
    lasted = sum(float(log.t[-1] - log.t[0]) + T_s for log in logs)
    return f"{words} in {segments} segments of a record of {lasted:.4g} s"
