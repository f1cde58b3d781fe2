"""Predictor of a drive's position over look-ahead windows, learning from their measurement; eqs. (2) to (6).

``x_h(k) = x_pb(k) + e_h(k)``, with ``e_h`` by a model of the residual ``e_pb = x − x_pb``. With the paper's,
``e_h = wᵀφ``: within a window, residuals not measured yet are replaced by their predictions, a free run of an ARX
recursion from the last ``p`` measured residuals, affine in the command.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import ParameterError, SignalError, StateError, check_kind
from ..base.files import as_path, write_whole
from ..base.settings import PredictorSettings, check, samples_before
from ..base.signals import Array, as_array, as_measured, as_samples
from ..base.state import arrays_of, pack, restored, restoring, unpack
from ..base.threads import one_blas_thread
from ..model.physics import ModalModel, Mode
from .averaging.features import Disturbance
from .averaging.model import AveragedModel
from .averaging.start import motion_before
from .paper import PaperModel
from .regression import RidgeRegression
from .uncertainty import Uncertainty, first_variance
from .window import FeatureScales, Forecast, PredictedWindow, Prediction, ResidualWindow, WindowOperator

_KIND = "predictor"

_ResidualModel: TypeAlias = PaperModel | AveragedModel  # model of the residual: a record; its methods return another


@dataclass(frozen=True, eq=False)
class PredictorState:
    """What is known between two windows; it is saved as it is."""

    k: int  # samples of this run that are measured
    n_init: int  # samples of its warm-up
    start: float | None  # m: initial position; None until it is known. All other positions are relative to it
    physics: Array  # (n_state,), m: state of ``G_pb`` after the measured samples
    late: Array  # (n_late,), m: commands that are predicted and not measured yet
    residual: _ResidualModel
    uncertainty: Uncertainty


class HybridPredictor:
    """Predictor of a drive's position by windows, learning from their measurement; eqs. (2) to (6).

    For each window, call :meth:`predict` with its commands, then :meth:`update` with the measured positions.
    :meth:`predict` does not change the weights. Memory and cost per window are constant. With a ``measurement_delay``
    what arrives over a window was measured that many samples earlier; what is not measured yet is predicted anew.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``, eq. (15).
    settings : PredictorSettings, optional
        The defaults if left out.
    start : float, optional
        Initial position, m, at rest; the first command if left out. Positions are relative to it internally, because
        ridge regression is not invariant to an offset.
    disturbances : iterable of Disturbance, optional
        With averaging: more candidate disturbances, functions ``d(x, v)`` of positions, m, and commanded velocities,
        m/s, ``(n,)`` each, in any unit; what they are worth is learned. A compensator follows their slopes, taken over
        the motion of a sample. They are not part of a saved state, or of an FMU.

    Attributes
    ----------
    preview : int
        Samples of the command that a compensator, which decides it, knows ahead; 0 without one.
    state : PredictorState
    pending : PredictedWindow, optional
        The predicted window, until it is measured.

    Raises
    ------
    ParameterError
        If disturbances are given without averaging, or are not functions.
    """

    def __init__(
        self,
        model: ModalModel,
        settings: PredictorSettings | None = None,
        *,
        start: float | None = None,
        disturbances: Iterable[Disturbance] = (),
    ) -> None:
        check_kind(ModalModel, model=model)
        check_kind(PredictorSettings | None, settings=settings)
        check_kind(Iterable, disturbances=disturbances)
        self.settings = settings = PredictorSettings() if settings is None else settings
        self.Np, self.T_s = settings.Np, settings.T_s
        self.model, self.disturbances, self.preview = model, tuple(disturbances), 0
        self.discrete = model.discretise(self.T_s, settings.input_hold, block=self.Np)
        if self.disturbances and not settings.averaging:
            raise ParameterError("disturbances are learned with averaging = true only")
        for i, one in enumerate(self.disturbances):
            if not callable(one):
                raise ParameterError(f"disturbances[{i}] must be a function of x and v, got {one!r}")
        residual = (
            AveragedModel.init(settings, self.discrete, self.disturbances)
            if settings.averaging
            else PaperModel.init(settings)
        )
        late, uncertainty = np.zeros(settings.n_late), Uncertainty.init(first_variance(settings))
        self.state = PredictorState(0, 0, None, self.discrete.rest(), late, residual, uncertainty)
        self.restart(start, t_init=settings.warm_up)

    def __repr__(self) -> str:
        """Return the main settings, and how much was learned, in one line."""
        names = ("Np", "p", "q", "T_s", "averaging")
        shown = {name: getattr(self.settings, name) for name in names} | {"n_learned": int(self.regression.n_rows)}
        return f"HybridPredictor({', '.join(f'{name} = {value!r}' for name, value in shown.items())})"

    def restart(self, start: float | None = None, *, t_init: float = 0.0) -> None:
        """Begin another run, at rest at ``start``, m, or the first command; what was learned is kept (warm start).

        ``t_init``, s, is its warm-up, none by default; −1: automatic.
        """
        rest = None if start is None else float(as_samples([start], "start")[0])
        n_init = samples_before(replace(self.settings, t_init=t_init).warm_up, self.T_s)
        residual, late = self.residual.restart(), np.zeros(self.settings.n_late)
        self.state = PredictorState(0, n_init, rest, self.discrete.rest(), late, residual, self.state.uncertainty)
        self.pending: PredictedWindow | None = None

    def plan_ahead(self, preview: int) -> None:
        """Adapt to a compensator, which moves the drive as it commands, from rest, ``preview`` samples ahead."""
        self.preview = preview
        self.state = replace(self.state, residual=self.residual.plan_ahead(preview))

    @property
    def learned_with(self) -> dict[str, float]:
        """All settings, and the modes, on which what is learned depends, by their names in an FMU."""
        numbers, parameters = self.settings.to_fmi(), PredictorSettings.fmi_parameters()
        values: dict[str, float] = {name: numbers[name] for name, one in parameters.items() if one.learned}
        values["dead_time"] = self.model.dead_time
        for i, mode in enumerate(self.model.modes, start=1):
            values |= {f"mode[{i}].{name}": value for name, value in asdict(mode).items()}
        return values

    def differences(self, trained: "HybridPredictor") -> list[str]:
        """Return, in words, what a predictor has with which its weights cannot be taken; its window may be another."""
        check_kind(HybridPredictor, trained=trained)
        found, expected = (
            {**one.learned_with, "input_hold": one.settings.input_hold, "disturbances": len(one.disturbances)}
            for one in (trained, self)
        )
        return [
            f"{name} = {found.get(name, 'none')} instead of {expected.get(name, 'none')}"
            for name in {**expected, **found}
            if found.get(name) != expected.get(name)
        ]

    def take_over(self, learned: Any, uncertainty: Uncertainty, regressions: tuple[RidgeRegression, ...]) -> None:
        """Take over what another predictor has learned, without its run; :meth:`restart` then begins one."""
        residual = self.residual.take_over(learned, regressions)
        self.state = replace(self.state, residual=residual, uncertainty=uncertainty)

    def begin_with(self, trained: "HybridPredictor") -> None:
        """Begin a run at rest with what another predictor has learned, such as one of longer windows.

        StateError, naming all that differs, if that was learned with another model or other features, or if it has
        learned nothing.
        """
        if differing := self.differences(trained):
            raise StateError(f"the trained predictor must have this model and features: it has {', '.join(differing)}")
        if trained.regression.n_rows == 0:
            raise StateError("the trained predictor has learned no sample")
        self.take_over(trained.residual.learned, trained.state.uncertainty, trained.residual.regressions)
        self.restart()

    @one_blas_thread
    def predict(self, x_d: ArrayLike, *, path: Array | None = None, scales: FeatureScales | None = None) -> Prediction:
        """Predict the next window from its commands and all earlier measurements; eqs. (2), (4).

        May be called again, with other commands or another length, before :meth:`update`; the last call counts.

        ``x_d``, (n,), m: commands to the drive, with known loads, over the next ``n ≥ 1`` samples, usually ``Np``. From
        a compensator: ``path``, (m,), m: commands of its preview before they are modified; with averaging ``scales`` of
        the features. Both from ``x_d`` if left out. SignalError if ``x_d`` is empty, not one-dimensional or not finite.
        """
        command, state = as_samples(x_d, "x_d", T_s=self.T_s), self.state
        n, late = len(command), len(state.late)
        start = float(command[0]) if state.start is None else state.start
        path = np.concatenate((state.late, (command if path is None else as_samples(path, "path")) - start))
        command = np.concatenate((state.late, command - start))
        x_pb, _ = self.discrete.forced_response(state.physics, command)  # Eq. (2)
        forecast = state.residual.forecast(ResidualWindow(command, x_pb, start, path), scales)
        self.pending = self._with_error(forecast)
        std = np.maximum(self.pending.error.std[late:], state.residual.farthest)
        return Prediction(x_pb[late:] + start, forecast.e_h[late:], std, self._warm_up(n))

    def _with_error(self, forecast: Forecast) -> PredictedWindow:
        """Return the window of a forecast with what is known of its error, pending measurement."""
        # With a measurement_delay the window begins that many samples earlier: they are not measured yet
        x_pb, n = forecast.window.x_pb, len(forecast.e_h)
        active = np.arange(n) >= self._warm_up(n, late=len(self.state.late))
        e_h, variance = np.where(active, forecast.e_h, 0.0), np.where(active, forecast.variance, 0.0)
        return PredictedWindow(forecast, self.state.uncertainty.predict(x_pb, e_h, variance, self.Np))

    @one_blas_thread
    def update(self, x: ArrayLike, *, learn: bool = True, ahead: Array | None = None) -> None:
        """Learn from the measurement of the predicted window, or of its first samples; eq. (6).

        ``x``, (m,), m: measured positions that arrived, ``1 ≤ m ≤ n`` of the last :meth:`predict`; ``learn``: whether
        they enter the regression; the next window starts from their residuals in any case; ``ahead``: from a
        compensator with averaging, as :meth:`AveragedModel.learn` takes it.

        SignalError if nothing was predicted, ``x`` is longer than the window, or a value is not finite; nothing is
        changed then.
        """
        if self.pending is None:
            raise SignalError("update must follow predict: there is no predicted window to measure")
        state, forecast, error = self.state, cast(Any, self.pending.forecast), self.pending.error
        residual, physics, may_miss = state.residual, state.physics, self.settings.averaging
        if not 1 <= (measured := as_array(x, "x", T_s=self.T_s)).size <= self.n_pending:
            raise SignalError(f"x must have 1 … {self.n_pending} samples, as predicted, got {measured.size}")
        measured = (as_measured if may_miss else as_samples)(measured, "x")
        m, start, late = len(measured), forecast.window.start, len(state.late)
        e_pb = measured - start - forecast.window.x_pb[:m]
        if state.k == 0 and may_miss and not self.preview:
            # The run may have begun in motion.
            x_d, x_pb, _, path = forecast.window
            before = motion_before(self.model, self.discrete, x_d, e_pb - error.e_h[:m], late)
            if before is not None:
                window = ResidualWindow(x_d + before.x_d, x_pb + before.x_pb, start, path)
                physics, e_pb = physics + before.state, e_pb - before.x_pb[:m]
                forecast = replace(forecast, window=window, of_physics=None)
                residual = residual.begin_in_motion(window, forecast.scales)
        residual, accepted = residual.learn(forecast, measured - start, fold=learn, ahead=ahead)
        uncertainty = state.uncertainty.learn(error, e_pb, accepted, self.Np) if learn else state.uncertainty
        x_d, on_the_way = forecast.window.x_d, forecast.window.x_d[m : m + late].copy()
        _, physics = self.discrete.forced_response(physics, x_d[:m])
        self.state = PredictorState(state.k + m, state.n_init, start, physics, on_the_way, residual, uncertainty)
        self.pending = None

    def operator(self, n: int | None = None) -> WindowOperator:
        """Return the lifted prediction of the next ``n`` (default ``Np``) samples, affine in their commands; eq. (3).

        It is the hybrid model, during the warm-up too.

        ParameterError with averaging, whose model is not affine in the commands, or if ``n < 1``; SignalError if the
        initial position is neither given nor known from a predicted window.
        """
        if self.settings.averaging:
            raise ParameterError("the operator needs the paper's model, averaging = false")
        g_pb, free_pb, start = self._physics_from_rest(self.Np if n is None else n)
        g_h, free = cast(PaperModel, self.residual).operator(g_pb, free_pb)
        late = len(self.state.late)
        return WindowOperator(
            g_h=g_h,
            free=free[late:] + start * (1.0 - np.cumsum(g_h)),
            g_pb=g_pb,
            free_pb=free_pb[late:] + start * (1.0 - np.cumsum(g_pb)),
        )

    def physics_operator(self, n: int) -> tuple[Array, Array]:
        """Return the first column of ``G_pb``, m/m, and its free response, relative to the start, m, ``(n,)`` each."""
        g_pb, free, _ = self._physics_from_rest(n)
        return g_pb, free[len(self.state.late) :]

    def _physics_from_rest(self, n: int) -> tuple[Array, Array, float]:
        """Return the first column of ``G_pb``, its free response from the late samples on, and the start."""
        n = check("Np", n, label="n")
        start = self.start if self.start is not None or self.pending is None else self.pending.forecast.window.start
        if start is None:
            raise SignalError("the start is not known yet: give start= or predict the first window before")
        late = self.state.late
        free, _ = self.discrete.forced_response(self.state.physics, np.concatenate((late, np.zeros(n))))
        return self.discrete.impulse_response(n), free, start

    @property
    def k(self) -> int:
        """Samples of this run that are measured."""
        return self.state.k

    @property
    def n_init(self) -> int:
        """Samples of the run's warm-up."""
        return self.state.n_init

    @property
    def start(self) -> float | None:
        """Initial position, m; None until it is known."""
        return self.state.start

    @property
    def residual(self) -> _ResidualModel:
        """State of the residual model."""
        return self.state.residual

    @property
    def regression(self) -> RidgeRegression:
        """Regression of all learned samples, of the residual model."""
        return self.residual.regressions[0]

    @property
    def weights(self) -> Array:
        """``w`` of eq. (6) from all learned samples, ``(n,)``; with averaging without penalties: not what predicts."""
        return self.regression.weights

    @property
    def n_pending(self) -> int:
        """Samples of the predicted window pending measurement; 0 if there is none."""
        return 0 if self.pending is None else len(self.pending.forecast.e_h) - len(self.state.late)

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible; 0 without averaging."""
        return self.residual.n_rejected

    def _warm_up(self, n: int, *, late: int = 0) -> int:
        """Return how many of ``n`` samples, the next ones or from ``late`` samples before, are within the warm-up."""
        return min(max(self.n_init - self.k + late, 0), n)

    def to_bytes(self) -> bytes:
        """Return parameters and state, a pending window included, as a versioned blob."""
        meta = {
            "settings": asdict(self.settings),
            "dead_time": self.model.dead_time,
            "n_disturbances": len(self.disturbances),
            "preview": self.preview,
            "pending_start": None,
        }
        modes = [[mode.f_n, mode.zeta, mode.alpha, mode.beta] for mode in self.model.modes]
        arrays = {"modes": np.array(modes), **arrays_of(self.state)}
        if self.pending is not None:  # its forecast follows from the state
            forecast = self.pending.forecast
            x_d, x_pb, _, path = forecast.window
            arrays |= {"pending_x_d": x_d, "pending_x_pb": x_pb, "pending_path": path}
            meta["pending_start"] = forecast.window.start
            if (scales := forecast.scales) is not None:  # a compensator has them from its preview
                arrays["pending_scales"] = np.array([scales.velocity, scales.step])
                arrays["pending_largest"] = scales.largest
        return pack(_KIND, meta, arrays)

    @classmethod
    def from_bytes(cls, blob: bytes | bytearray, disturbances: Sequence[Disturbance] = ()) -> "HybridPredictor":
        """Return the predictor of :meth:`to_bytes`, given the ``disturbances`` that it was learned with.

        StateError if the blob is foreign, truncated or of another version, or the number of disturbances differs.
        """
        meta, arrays, _ = unpack(_KIND, blob)
        with restoring(_KIND):
            if (n := meta["n_disturbances"]) != len(disturbances):
                raise StateError(
                    f"the saved predictor was learned with {n} disturbances of the user's own, got {len(disturbances)}:"
                    " they are functions, which neither a state nor an FMU holds; in Python give them as disturbances="
                )
            model = ModalModel([Mode(*row) for row in arrays["modes"].tolist()], meta["dead_time"])
            predictor = cls(model, PredictorSettings.from_table(meta["settings"]), disturbances=disturbances)
            if meta["preview"]:
                predictor.plan_ahead(meta["preview"])
            predictor.state = restored(predictor.state, arrays)
            if (start := meta["pending_start"]) is not None:
                scales = None
                if "pending_scales" in arrays:
                    velocity, step = arrays["pending_scales"].tolist()
                    scales = FeatureScales(velocity, arrays["pending_largest"], step)
                window = ResidualWindow(arrays["pending_x_d"], arrays["pending_x_pb"], start, arrays["pending_path"])
                predictor.pending = predictor._with_error(predictor.residual.forecast(window, scales))
        return predictor

    def save(self, path: str | Path) -> None:
        """Write :meth:`to_bytes` to a file."""
        write_whole(path, self.to_bytes())

    @classmethod
    def load(cls, path: str | Path, disturbances: Sequence[Disturbance] = ()) -> "HybridPredictor":
        """Return the predictor of :meth:`save`; :meth:`restart` then begins a warm-started run.

        StateError if the file is not a saved predictor, or was learned with another number of disturbances.
        """
        return cls.from_bytes(as_path(path).read_bytes(), disturbances)
