"""Replay of a predictor over a random drive."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from c_core import TABLES, CModel, RefusedError

from hybridsep.base.errors import SignalError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.evaluate.peers import Piece, predict_peers
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor
from random_drives.drive import Drive

DIVERGED = 1.0  # largest prediction error, m, beyond which a prediction counts as diverged: beyond any of the strokes

Replayed = Callable[[str, ModalModel, PredictorSettings, Array, Array], Array]
"""Replay of a predictor of :data:`PREDICTORS`, with the physics model and the drive's settings, over commanded and
measured positions, (n,), m. It returns x_h, (n,), m, each window predicted before its measurement is known; SignalError
if it refuses a sample."""

PREDICTORS: dict[str, Callable[[PredictorSettings], PredictorSettings]] = {
    "default": lambda settings: settings,
    "paper": lambda settings: replace(settings, averaging=False),
}
"""Settings of a predictor, from the settings of a drive."""


def library_replay(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    """Return ``x_h`` of the library's predictor, ``(n,)``, m; with averaging ``x_meas`` is NaN where missing."""
    return backtest(HybridPredictor(model, PREDICTORS[predictor](settings)), x_d, x_meas).x_h


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


def physics_alone(drive: Drive) -> Array:
    """Return ``x_pb`` from rest, ``(n,)``, m."""
    discrete = drive.model.discretise(drive.settings.T_s)
    start = drive.x_d[0]
    return np.asarray(start + discrete.forced_response(discrete.rest(), drive.x_d - start)[0])


def _hold(x_pb: Array, x_meas: Array, Np: int) -> Array:
    """Return ``x_pb`` plus the last residual measured before each window, ``(n,)``, m."""
    last = np.concatenate(([0.0], (x_meas - x_pb)[Np - 1 :: Np]))
    return np.asarray(x_pb + np.repeat(last, Np)[: len(x_pb)])


def core_replay(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    """Return ``x_h`` of the C core's predictor, ``(n,)``, m; with averaging ``x_meas`` is NaN where missing."""
    outputs = core_outputs(predictor, model, settings, x_d, x_meas, ("x_h",))
    return np.asarray(outputs[0])


def core_outputs(
    predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array, names: Sequence[str]
) -> Array:
    """Return outputs of the C core's predictor, ``(len(names), n)``, m.

    A last window that is cut off is predicted as part of a whole one, beyond whose end the command rests; the library
    predicts it alone.
    """
    used = PREDICTORS[predictor](settings)
    Np, n, modes = used.Np, len(x_d), model.modes
    name = f"predictor of {len(modes)} modes"
    any_modes = TABLES["predictor"].modes * len(modes)
    TABLES.setdefault(name, replace(TABLES["predictor"], name=name, modes=any_modes))
    start = {f"mode[{i}].{key}": value for i, mode in enumerate(modes, 1) for key, value in asdict(mode).items()}
    start |= {**used.to_fmi(), "dead_time": model.dead_time, "x_d_ahead": x_d[0], "x_meas": x_d[0]}
    core = CModel(name, start).initialise()
    outputs: Array = np.empty((n, len(names)))
    x_d_ahead, measured = (core.place[key] for key in ("x_d_ahead", "x_meas"))
    shown = [core.place[name] for name in names]
    try:
        for k in range(n + Np - 1):
            core.values[x_d_ahead] = x_d[min(k, n - 1)]
            core.values[measured] = x_meas[k - Np] if k >= Np else x_d[0]
            core.step(k * used.T_s, used.T_s)
            if k + 1 >= Np:
                outputs[k + 1 - Np] = core.values[shown]
    except RefusedError as error:
        raise SignalError(str(error)) from error
    return np.asarray(outputs.T)
