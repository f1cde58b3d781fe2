"""Plant that a fit leaves to try with: modes, friction and stiffness, fitted together to the log (output error).

``x = G (x_d − d)`` with ``d = f·tanh(v_d/v_friction) + κ·x·|x|``; the fit starts at the identified model, which stays
the plant unless the fitted one is better on the last third of the training samples. Results on this plant are
optimistic: the compensator has features for just these disturbances.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from ..base.errors import ParameterError
from ..base.metrics import rms
from ..base.settings import PARAMETERS, PredictorSettings
from ..base.signals import Array
from ..identify.output_error import delayed, in_time
from ..identify.structure import polynomials
from ..logs.checks import noise_std, resolution, starts_in_motion
from ..logs.units import DisplayUnits
from ..model.discrete import DiscreteModel
from ..model.physics import ModalModel, Mode
from ..plants.stage_drive import StageDrive
from .replay import Recording

_FITTED = 2 / 3  # share of the training samples that the fit takes; the others choose
_COMMANDS_MAX = (
    20_000  # most samples of the commands to try with: 20 s at 1 kHz, which a co-simulation takes seconds for
)

_MODE_STEPS, _MODE_REACH = (0.1, 0.3, 0.05, 0.05), (1.0, 2.0, 1.0, 1.0)
"""Steps and bounds of a mode's changes: log f_n, log zeta, alpha/ω² and beta/ω."""

_SMALLEST_SPREAD = 1e-3  # least velocity over which friction changes sign, relative to the largest commanded one


@dataclass(frozen=True)
class IdentifiedPlant:
    """Plant of a fit."""

    entries: Mapping[str, Any]  # of the section ``[plant]`` of a machine file
    # RMS of what was measured less the plant and less the physics model, over the test samples, without their offset,
    # m; NaN where there are none
    rms: float = math.nan
    rms_pb: float = math.nan
    reason: str = ""  # why there is no plant to this model, empty if there is one

    @property
    def disturbed(self) -> bool:
        """Whether it has the friction and the stiffness of the log."""
        return "mode" in self.entries

    def words(self, shown: DisplayUnits) -> str:
        """Return what the plant is, and how far it follows the log, in words."""
        words = "the identified model "
        words += "refitted with the friction and stiffness of the log" if self.disturbed else "alone"
        if math.isfinite(self.rms):
            words += f"; it follows the held-out half to {shown.words(self.rms)} RMS"
            words += f" (physics model {shown.words(self.rms_pb)})" if self.disturbed else ""
        return f"{words}. A plant to try with, no measurement: results on it are optimistic"


class _Disturbed(NamedTuple):
    model: ModalModel
    f: float  # friction, as an offset of the command, m
    kappa: float  # stiffness, κ x |x| as an offset of the command, 1/m
    v_friction: float  # velocity of the friction's change of sign, m/s

    def entries(self) -> dict[str, Any]:
        """Return the entries of the section ``[plant]``."""
        own = {name: float(f"{getattr(self, name):.5g}") for name in ("f", "kappa", "v_friction")}
        modes = [{name: float(f"{value:.7g}") for name, value in asdict(one).items()} for one in self.model.modes]
        return {**own, "mode": modes}


class _Piece:
    """Piece of a recording, relative to its first command.

    ``u``, ``x``, ``v_d``, (n,): commands and measured positions, m; commanded velocity, m/s; ``path``, (n,), m:
    position by the identified model, which the stiffness acts at; ``fitted``, ``choosing``, ``judging``, (n,):
    samples for fitting, for choosing, and for the test.
    """

    def __init__(self, discrete: DiscreteModel, recording: Recording, late: int) -> None:
        x_d, x = in_time(recording.x_d, recording.x, late)
        self.u, self.x = x_d - x_d[:1], x - x_d[:1]
        self.v_d = np.diff(self.u, prepend=0.0) / discrete.T_s
        self.path = discrete.forced_response(discrete.rest(), self.u)[0]
        self.friction = lru_cache(2)(lambda v_friction: np.tanh(self.v_d / v_friction))  # most steps leave it as it is
        n, n_train = np.arange(len(x_d)), recording.n_train
        # The model has forgotten then how it began, but for 1 % of its motion
        slowest = float(np.abs(np.linalg.eigvals(discrete.A)).max(initial=0.0))
        settles = math.ceil(math.log(0.01) / math.log(slowest)) if 0.0 < slowest < 1.0 else 0
        known = ~np.isnan(x) & (n >= min(discrete.dead_time + settles, n_train // 4))
        self.fitted = known & (n < _FITTED * n_train)
        self.choosing = known & (n >= _FITTED * n_train) & (n < n_train)
        self.judging = known & (n >= recording.judges_from)


def _errors(settings: PredictorSettings, plant: _Disturbed, pieces: Sequence[_Piece]) -> list[Array]:
    """Return what was measured of each piece less the plant's position, ``(n,)``, m, with the sensor's offset."""
    of_modes, found = [], []
    for mode in plant.model.modes:
        theta, weights = np.log([mode.omega, mode.zeta]), np.array([mode.alpha / mode.omega**2, mode.beta / mode.omega])
        numerators, denominator = polynomials(theta, settings.T_s, settings.input_hold)
        of_modes.append((weights @ numerators, denominator))
    for one in pieces:
        disturbance = plant.f * one.friction(plant.v_friction) + plant.kappa * one.path * np.abs(one.path)
        u = delayed(one.u - disturbance, plant.model.dead_time)
        found.append(np.asarray(one.x - sum(lfilter(*of_mode, u) for of_mode in of_modes)))
    return found


def identified_plant(
    model: ModalModel, settings: PredictorSettings, recordings: Sequence[Recording], fitted: Sequence[Recording]
) -> IdentifiedPlant:
    """Return the plant of a fit of the identified model: recordings choose and judge it, their beginnings fit it."""
    try:
        StageDrive(model, T_s=settings.T_s, input_hold=settings.input_hold)
    except ParameterError as error:
        return IdentifiedPlant({}, reason=str(error))
    discrete = model.discretise(settings.T_s, settings.input_hold)
    pieces, begun = (
        [_Piece(discrete, one, settings.n_late) for one in given if len(one.x_d) > 1] for given in (recordings, fitted)
    )
    alone = _Disturbed(model, 0.0, 0.0, PARAMETERS["v_friction"].default)
    candidates = [alone, *_refined(alone, settings, begun)]
    errors = [_rms_of(settings, one, pieces, "choosing") for one in candidates]
    best = int(np.argmin(errors))  # the first where none is known
    if not errors[best] < 0.9 * errors[0]:  # no disturbance is worth it
        best = 0
    chosen = candidates[best]
    entries = {**(chosen.entries() if best else {}), "noise_std": float(f"{_noise(settings, chosen, pieces):.3g}")}
    rms_pb, rms_plant = (_rms_of(settings, one, pieces, "judging") for one in (alone, chosen))
    return IdentifiedPlant(entries, rms_plant, rms_pb)


def commands_to_try(recordings: Sequence[Recording]) -> Array:
    """Return commands of a log to try with, m: its first 20 000 from where it moves, to rest where it rests.

    They begin where the log began, as stiffness and what is learned of the position count from there; where that is in
    motion, with a lead-in from rest to its velocity, by half the largest acceleration of the commands: what counts from
    the start is off by it then.
    """
    distances = [float(np.abs(np.diff(one.x_d)).sum()) for one in recordings]
    found = recordings[distances.index(max(distances))].x_d
    moving = np.flatnonzero(np.diff(found))
    found = found[max(int(moving[0]) - 100, 0) if len(moving) else 0 :][:_COMMANDS_MAX]  # from 100 samples of rest on
    steps = np.abs(np.diff(found))
    at_rest = np.flatnonzero(steps <= 1e-3 * steps.max(initial=0.0)) + 1
    last = int(at_rest[-1]) + 1 if len(at_rest) else 0
    found = found[:last] if last > len(found) // 2 else found
    if not starts_in_motion(found):
        return found
    over = min(10, len(found) - 1)  # samples: a command may be held
    first = (found[over] - found[0]) / over
    acceleration = float(np.abs(np.diff(found[::over], 2)).max(initial=0.0)) / over**2
    n = math.ceil(3.0 * abs(first) / max(acceleration, 1e-3 * abs(first)))
    share = np.arange(n, 0, -1) / n  # of the way to the first sample, backwards
    return np.concatenate((found[0] - np.cumsum(first * share**2 * (3.0 - 2.0 * share))[::-1], found))


def _refined(alone: _Disturbed, settings: PredictorSettings, pieces: Sequence[_Piece]) -> list[_Disturbed]:
    """Return modes fitted together with friction, and with friction and stiffness; without what cannot be."""
    fitted = [piece for piece in pieces if piece.fitted.any()]
    fastest = max((float(np.abs(piece.v_d).max()) for piece in fitted), default=0.0)
    reach = max((float(np.abs(piece.path).max()) for piece in fitted), default=0.0)
    scale = _rms_of(settings, alone, pieces, "fitted")
    if not (scale > 0.0 and reach > 0.0 and fastest * _SMALLEST_SPREAD >= (PARAMETERS["v_friction"].minimum or 0.0)):
        return []
    n = 4 * len(alone.model.modes)

    def plant(theta: Array, with_stiffness: bool) -> _Disturbed:
        modes = [
            Mode(
                one.f_n * math.exp(f_n),
                one.zeta * math.exp(zeta),
                one.alpha + a * one.omega**2,
                one.beta + b * one.omega,
            )
            for one, (f_n, zeta, a, b) in zip(alone.model.modes, theta[:n].reshape(-1, 4).tolist(), strict=True)
        ]
        f, kappa, spread = theta[n:].tolist()
        moved = ModalModel(modes, alone.model.dead_time)
        return _Disturbed(moved, scale * f, with_stiffness * scale * kappa / reach**2, fastest * math.exp(spread))

    def residual(theta: Array, with_stiffness: bool) -> Array:
        errors = _errors(settings, plant(theta, with_stiffness), fitted)
        known = [error[piece.fitted] for piece, error in zip(fitted, errors, strict=True)]
        return np.concatenate([(error - error.mean()) / scale for error in known])

    reach_of_modes, found = np.tile(_MODE_REACH, n // 4), []
    bound = np.append(reach_of_modes, [1e3, 1e3, 0.0])
    least = np.append(-reach_of_modes, [0.0, 0.0, math.log(_SMALLEST_SPREAD)])
    steps = np.append(np.tile(_MODE_STEPS, n // 4), np.ones(3))
    # The example log needs 30 evaluations, a third of a second
    how: dict[str, Any] = {"bounds": (least, bound), "x_scale": steps, "max_nfev": 30}
    for with_stiffness in (False, True):
        start = np.append(np.zeros(n), [0.5, 0.5 if with_stiffness else 1e-9, math.log(0.02)])
        try:
            one = plant(least_squares(residual, start, args=(with_stiffness,), **how).x, with_stiffness)
            StageDrive(one.model, one.f, one.kappa, settings.T_s, v_friction=one.v_friction)
        except (ParameterError, ValueError):  # a mode out of range, or an error that overflowed
            continue
        found.append(one)
    return found


def _rms_of(settings: PredictorSettings, plant: _Disturbed, pieces: Sequence[_Piece], part: str) -> float:
    """Return the RMS error of a plant over a part of all pieces, m, less the mean error of what was fitted to."""
    each = [(one, getattr(one, part), e) for one, e in zip(pieces, _errors(settings, plant, pieces), strict=True)]
    parts = [e[i] - e[one.fitted if one.fitted.any() else i].mean() for one, i, e in each if i.any()]
    return rms(np.concatenate(parts)) if parts else math.nan


def _noise(settings: PredictorSettings, plant: _Disturbed, pieces: Sequence[_Piece]) -> float:
    """Return the standard deviation of the measurement noise, m, at least the resolution's."""
    both = [np.stack(one) for one in zip((one.x for one in pieces), _errors(settings, plant, pieces), strict=True)]
    known = [one[:, ~np.isnan(one[0])] for one in both]
    found = [max(min(noise_std(x), noise_std(e)), resolution(x) / math.sqrt(12.0)) for x, e in known]
    return min(float(np.median(found)), float(PARAMETERS["noise_std"].maximum or 1.0)) if found else 0.0
