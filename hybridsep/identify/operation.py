"""Identification of ``G_pb`` from operation in closed loop: commanded and measured positions of a recording."""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import IdentificationError
from ..base.settings import check
from ..base.threads import one_blas_thread
from ..logs.units import DisplayUnits, shown_in
from ..model.physics import ModalModel
from . import selection
from .model import Alternative, IdentifiedModel
from .output_error import Delay, Fit, Segment, as_segments, fit_structure, motion_split, simulated
from .search import fit_near
from .structure import STRUCTURES, Structure
from .uncertainty import estimates

SAMPLES_MIN = 100  # samples below which nothing is identified

_WEAK = 3.0
"""Commanded motion in multiples of the unexplained one (standard deviations) below which only a gain of 1 is taken."""

_LEFT = 0.25
"""Share of the servo error that a model leaves from which friction may have shaped it; healthy recordings: 0.03."""

LITTLE_MOTION = 0.25  # share of samples in motion below which more of it is asked for
TOO_LITTLE = "too little motion in"  # beginning of the finding that a part of a log tells no dynamics

Progress = Callable[[str, float], object]


@one_blas_thread
def identify_operation(
    recordings: Iterable[tuple[ArrayLike, ArrayLike]],
    T_s: float,
    *,
    order_max: int = 6,
    unit: str = "m",
    shown: DisplayUnits | None = None,
    part: str = "this log",
    progress: Progress = lambda _message, _done: None,
) -> IdentifiedModel:
    """Identify the physics model from recordings of one axis in operation.

    The error of the simulated position is least over poles, zeros, gain, whole samples of dead time and the hold, for
    structures from a mere gain to three modes; offset and state at the start of each recording are estimated beside
    them. The last 35 % of the commanded motion choose among the structures, fitted to what comes before. A second order
    takes the place of one that explains little more but friction; and, if it is as good, one with a shorter dead time,
    or a usual damping and a zero, of one with a long dead time, or hardly any damping. All is then fitted to.

    ``recordings``: iterable of pairs ``(x_d, x)`` of (n,), m: commanded and measured positions, one pair for each
    piece without a gap, sampled alike; ``x`` is NaN where it is missing. Such samples are left out of the error, the
    model runs over them; ``T_s``: sampling interval, s; ``order_max``: largest number of poles, at least 1; ``unit``:
    {"m", "rad"}: unit of the positions, for estimates; ``shown``: units in which findings say errors; ``unit``'s if
    left out; ``part``: what the recordings are, for findings and errors; ``progress``: called with a message and the
    fraction done.
    IdentificationError if the recordings cannot determine a model, with the reason; SignalError if samples are not
    finite or of different lengths; ParameterError if ``T_s`` is out of its range.
    """
    T_s, shown = check("T_s", T_s), shown or shown_in(unit)
    segments = as_segments(recordings)
    if reason := _hindrance(segments):
        raise IdentificationError(f"{part} cannot determine a model, because {reason}")
    structures = [structure for structure in STRUCTURES if structure.order <= order_max]
    candidates = selection.compare_structures(segments, T_s, structures, progress)
    chosen = selection.with_slow_part(selection.choose(candidates), candidates, segments, T_s)
    chosen = selection.without_long_delay(selection.second_order(chosen, candidates, segments, T_s), segments, T_s)
    chosen = selection.well_damped(chosen, segments, T_s)
    candidates = list({one.structure: one for one in (*candidates, chosen)}.values())
    progress(f"{chosen.structure.name}: all samples", 0.95)
    fit = fit_near(segments, T_s, chosen.fit)
    findings = []
    residual = np.concatenate([(s.y - simulated(fit, s, T_s))[s.known] for s in segments])
    moved = float(np.sqrt(np.mean(np.concatenate([(s.u - s.u.mean()) ** 2 for s in segments]))))  # m
    if moved < _WEAK * float(np.std(residual)):
        fit = fit_structure(segments, T_s, Structure(0), Delay(0), [], slowest=1.0)
        spread, rest = shown.words(moved), shown.words(fit.rms)
        findings.append(
            f"{TOO_LITTLE} {part} to learn the dynamics from: the commanded position moves by {spread} (standard "
            f"deviation), and {rest} of the measured one are not explained by it; a gain of 1 without lag is taken"
        )
    parameters, n_effective = estimates(fit, segments, T_s, unit)
    findings += _findings(fit, chosen, segments, parameters[0].std, n_effective, shown, part)
    progress("identified", 1.0)
    return IdentifiedModel(
        model=ModalModel(fit.structure.modes(fit.theta, fit.linear, T_s), fit.delay.samples),
        input_hold=fit.delay.input_hold,
        T_s=T_s,
        unit=unit,
        structure=fit.structure.name,
        parameters=parameters,
        offset=fit.offset,
        rms=fit.rms,
        rms_held_out=chosen.rms_held_out,
        n_samples=sum(int(segment.known.sum()) for segment in segments),
        n_effective=n_effective,
        alternatives=tuple(_alternative(candidate, chosen) for candidate in candidates),
        findings=tuple(findings),
    )


def unit_gain_model(T_s: float, reason: str) -> IdentifiedModel:
    """Return a model that follows its command, for recordings that cannot determine one; ``reason`` is its finding."""
    model = ModalModel(Structure(0).modes(np.empty(0), np.empty(0), T_s))
    return IdentifiedModel(*(model, "foh", T_s, "m", Structure(0).name, (), 0.0, np.nan, np.nan, 0, 0.0, (), (reason,)))


def _hindrance(segments: Sequence[Segment]) -> str:
    """Return why there is nothing to learn from; empty if there is something."""
    n = sum(int(segment.known.sum()) for segment in segments)
    if n < SAMPLES_MIN:
        return f"it has {n} samples, at least {SAMPLES_MIN} are needed"
    if all(np.ptp(segment.u) == 0 for segment in segments):
        return "the commanded position does not move; record the axis while it works"
    if all(np.ptp(segment.y[segment.known]) == 0 for segment in segments):
        return "the measured position does not move"
    split = motion_split(segments, 1.0 - selection.HELD_OUT)
    n_fitted = sum(int(segment.known[: segment.stop].sum()) for segment in split)
    n_judging = sum(len(selection.held_out(segment)) for segment in split)
    if n < sum(len(segment.u) for segment in segments) and min(n_fitted, n_judging) < SAMPLES_MIN // 4:
        return (
            f"too many measured positions are missing: {n_fitted} are left in the part that is fitted to, {n_judging} "
            "in the test part"
        )
    return ""


def _alternative(candidate: selection.Candidate, chosen: selection.Candidate) -> Alternative:
    fit, objection = candidate.fit, candidate.objection
    if not objection and candidate is not chosen and candidate.slow_parts:
        objection = f"zeros all but cancel a slow part of {candidate.slow_parts[0]:.3g} Hz, and it explains too little"
    return Alternative(fit.structure.name, fit.structure.n_parameters, fit.rms, candidate.rms_held_out, objection)


def _findings(
    fit: Fit,
    chosen: selection.Candidate,
    segments: Sequence[Segment],
    gain_std: float,
    n_effective: float,
    shown: DisplayUnits,
    part: str,
) -> list[str]:
    findings = []
    n = sum(int(segment.known.sum()) for segment in segments)
    moving = sum(np.count_nonzero(np.diff(s.u)) for s in segments) / sum(len(s.u) for s in segments)
    if moving < LITTLE_MOTION:
        findings.append(f"the command moves in {100 * moving:.0f} % of the samples of {part}")
    if n_effective < 0.2 * n:
        findings.append(
            f"the residual is not white (friction and the like): {n} samples tell as much as {n_effective:.0f} "
            "independent ones, which the standard deviations take into account"
        )
    error = float(np.std(np.concatenate([(s.y - s.u)[s.known] for s in segments])))
    if fit.rms > _LEFT * error:
        why = (
            "friction, a dead band, or what repeats moves its modes by more than their standard deviations say; record"
        )
        why = f"{why} faster" if fit.structure.order else "no loop is seen; record longer, or faster"
        findings.append(
            f"the loop is not identified: of a servo error of {shown.words(error)} (standard deviation) the model "
            f"leaves {shown.words(fit.rms)}; {why} motion, which does not help against a dead band (a valve's "
            "overlap), or give the loop's gains (cascade)"
        )
    if fit.structure.zeta:
        findings.append(
            f"{part} does not tell how the loop is damped, which follows without a lag (feed-forward, integrators): a "
            f"damping ratio of {fit.structure.zeta} is taken; give the loop's gains (cascade) if they are known"
        )
    gain = float(fit.structure.gains(fit.linear)[0].sum())
    if not fit.structure.unit_gain:
        # The decimals of the two leading digits of the standard deviation, seven at most
        decimals = 1 - math.floor(math.log10(gain_std)) if 0.0 < gain_std < math.inf else 7
        findings.append(f"the static gain is {gain:.{min(max(decimals, 0), 7)}f} ± {gain_std:.2g}")
    if fit.structure.order and chosen.rms_held_out > 2 * chosen.fit.rms:
        findings.append(
            f"the error on the part that was held out, {shown.words(chosen.rms_held_out)}, is "
            f"{chosen.rms_held_out / chosen.fit.rms:.1f} times the error of the fit before it: the later motion is of "
            "another kind, or the axis is not linear"
        )
    return findings
