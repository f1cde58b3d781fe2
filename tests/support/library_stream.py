"""The library's models from the values of an FMU's parameters, trained, and as streams, stepped as FMUs are."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from built_once import built_once, shared_builds
from stream import CANNOT, LIBRARY, OUTPUTS, PREDICTOR, Array, RefusedStreamError, Value, kind_of, table_of_model

from hybridsep import HybridSepError
from hybridsep.base.clock import SampleClock
from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, PredictorSettings
from hybridsep.base.signals import check_position
from hybridsep.base.state import pack, unpack
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.cosim.loop import cosimulate
from hybridsep.evaluate.backtest import backtest
from hybridsep.fmi.variables import modes_from
from hybridsep.fmi.weights import restore_weights, weights_file
from hybridsep.machines.machine import paper_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.stage_drive import StageDrive
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.regression import RidgeRegression


def library_predictor(values: Mapping[str, Any]) -> HybridPredictor:
    """Return the predictor; ``dead_time`` and ``mode[i].*`` must be among the values."""
    model = ModalModel([Mode(**mode) for mode in modes_from(values)], values["dead_time"])
    return HybridPredictor(model, PredictorSettings.from_fmi(values))


def library_compensator(values: Mapping[str, Any]) -> SepCompensator:
    """Return the compensator."""
    return SepCompensator(library_predictor(values), CompensatorSettings.from_fmi(values))


def learned_file(saved: Path | None) -> bytes:
    """Return the content of ``weights.bin`` for a saved predictor; none without one."""
    return weights_file(HybridPredictor.load(saved)) if saved else b""


def trained_state(kind: str) -> Path:
    """Return a file with the predictor of the default machine's FMU ``kind`` after one staircase, saved once."""
    machine, encoder = paper_machine("spring_mass_damper"), Encoder(5e-6, 7)

    def train(path: Path) -> None:
        if kind == PREDICTOR:
            predictor, x = machine.new_predictor(), simulate(machine.new_plant(), staircase(), machine.T_s)
            backtest(predictor, staircase(), encoder.measure_all(x))
        else:
            compensator = machine.new_compensator()
            cosimulate(compensator, machine.new_plant(), staircase()[:2500], encoder=encoder)
            predictor = compensator.predictor
        predictor.save(path)

    return built_once(shared_builds() / f"{kind}.state", train)


def runaway_predictor() -> HybridPredictor:
    """Return a predictor of the default machine, without warm-up, whose learned recursion diverges."""
    # It has a bias and one past residual, so firmly learned that a run changes nothing
    machine = paper_machine("spring_mass_damper")
    predictor = machine.new_predictor(replace(machine.predictor_settings, t_init=0.0))
    weights = np.zeros(predictor.regression.n_features)
    weights[0], weights[2 + predictor.settings.q] = 1e-3, 1e5
    factor = np.asfortranarray(1e6 * np.eye(predictor.regression.n_features + 1))
    factor[:-1, -1] = factor[:-1, :-1] @ weights
    predictor.take_over((), predictor.state.uncertainty, (RidgeRegression(factor, 1000.0),))
    return predictor


@contextmanager
def refusing() -> Iterator[None]:
    """Turn the library's errors into the streams'."""
    try:
        yield
    except HybridSepError as error:
        raise RefusedStreamError(str(error)) from error


def start_values(model: str) -> dict[str, Any]:
    """Return the start values of a model's inputs and parameters."""
    table = table_of_model(model)
    inputs = {"x_d": 0.0} if "FeedDrive" in model else {"x_d_ahead": 0.0, "x_meas": 0.0, "x_load": 0.0, "reset": False}
    modes = {f"mode[{i}].{key}": value for i, mode in enumerate(table.modes, 1) for key, value in mode.items()}
    return {**inputs, **table.parameters, **modes}


class LibraryStream:
    """Base of the library's streams."""

    def __init__(self, model: str) -> None:
        self.model, self._kind = model, kind_of(model)
        self._values = start_values(model)

    def set(self, name: str, value: Value) -> None:
        self._values[name] = value

    def set_slope(self, name: str, slope: float) -> None:
        raise RefusedStreamError(CANNOT[LIBRARY, "slopes"])

    def outputs_before(self, values: Mapping[str, Value]) -> list[float]:
        raise RefusedStreamError(CANNOT[LIBRARY, "outputs before"])

    def window(self, name: str) -> Array:
        raise NotImplementedError

    def reset(self) -> None:
        self._values = start_values(self.model)

    def warnings(self) -> list[str]:
        return []

    def close(self) -> None:
        pass


class LookAheadStream(LibraryStream):
    """A look-ahead of the library behind the clock that FMUs use."""

    def __init__(self, model: str, weights: bytes = b"") -> None:
        super().__init__(model)
        self._weights = weights
        self._n_shown = int(self._values["Np"])
        self.reset()

    def reset(self) -> None:
        super().reset()
        if self._weights:
            self._values["t_init"] = 0.0

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._values |= values
        with refusing():
            made = (library_predictor if self._kind == PREDICTOR else library_compensator)(self._values)
            if self._weights:
                restore_weights(made.predictor if isinstance(made, SepCompensator) else made, self._weights)
            self._look_ahead = LookAhead(made, float(self._values["x_d_ahead"]))
            self._clock = SampleClock.begin(start, self._values["T_s"])
        self._latched: tuple[float, ...] = (self._values["x_d_ahead"],) * 2 + (0.0,)
        self._was_reset = False

    def step(self, t: float, h: float) -> None:
        """Latch the inputs at each instant within the step, and execute them where the next one is reached."""
        inputs = tuple(float(self._values[name]) for name in ("x_d_ahead", "x_meas", "x_load"))
        with refusing():
            if self._look_ahead.diverged:
                raise SignalError(self._look_ahead.diverged)
            step, pending = self._clock.stepped(t, h), self._clock.latched
            if step.n_latched:
                for name, value in zip(("x_d_ahead", "x_meas", "x_load"), inputs, strict=True):
                    if name != "x_meas" or not (np.isnan(value) and self._look_ahead.may_miss):
                        check_position(name, value, f" at sample {self._clock.k + pending}")
            self._tune()
            for _ in range(step.n_samples):
                self._look_ahead.sample(*(self._latched if pending else inputs))
                pending = False
        if step.after.latched and not pending:
            self._latched = inputs
        self._clock = step.after

    def _tune(self) -> None:
        compensator, reset = self._look_ahead.planner, bool(self._values.get("reset", False))
        if isinstance(compensator, SepCompensator):
            if reset and not self._was_reset:
                compensator.monitor.reset()
            tunable = ("compensate", "change_max", "following_error_max")
            compensator.change(**{name: PARAMETERS[name].from_fmi(self._values[name]) for name in tunable})
        self._was_reset = reset

    def outputs(self) -> list[float]:
        return [float(getattr(self._look_ahead, name)) for name in OUTPUTS[self._kind]]

    def window(self, name: str) -> Array:
        shown = np.zeros(self._n_shown)
        samples = getattr(self._look_ahead.window, name.removesuffix("_window"))[: self._n_shown]
        shown[: len(samples)] = samples
        return shown

    def save(self) -> bytes:
        meta = {"clock": self._clock, "latched": (*self._latched, self._was_reset), "values": self._values}
        return pack(f"stream {self.model}", meta, {}, {"core": self._look_ahead.to_bytes()})

    def restore(self, blob: bytes) -> None:
        with refusing():
            meta, _, parts = unpack(f"stream {self.model}", blob)
            self._look_ahead = LookAhead.from_bytes(
                parts["core"], HybridPredictor if self._kind == PREDICTOR else SepCompensator
            )
        self._clock, self._latched = SampleClock(*meta["clock"]), tuple(meta["latched"][:3])
        self._values, self._was_reset = meta["values"], meta["latched"][3]


class PlantStream(LibraryStream):
    """A plant of the library with its encoder."""

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._values |= values
        with refusing():
            self._plant = self._made(self._values)
            self._encoder = Encoder(self._values["noise_std"], self._values["seed"])
        self._plant.reset(float(self._values["x_d"]))
        self._x_meas = self._encoder.measure(self._plant.x)

    @staticmethod
    def _made(values: Mapping[str, Any]) -> FeedDrive | StageDrive:
        """Return the stage where there are modes among the values, the nonlinear drive otherwise."""
        if not (modes := modes_from(values)):
            return FeedDrive(*(values[name] for name in ("m", "c", "k", "c_nl", "k_nl")))
        chosen = {name: PARAMETERS[name].from_fmi(values[name]) for name in ("friction_on", "input_hold")}
        numbers = {name: values[name] for name in ("f", "kappa", "T_s", "v_friction")}
        return StageDrive(ModalModel([Mode(**mode) for mode in modes], values["dead_time"]), **numbers, **chosen)

    def step(self, t: float, h: float) -> None:
        with refusing():
            self._plant.step(float(self._values["x_d"]), h)
        self._x_meas = self._encoder.measure(self._plant.x)

    def outputs(self) -> list[float]:
        return [self._plant.x, self._plant.v, self._x_meas]

    def save(self) -> bytes:
        drawn = {"n_draws": self._encoder.n_draws, "x_meas": self._x_meas}
        return pack(f"stream {self.model}", {"plant": self._plant.state(), "values": self._values, **drawn}, {})

    def restore(self, blob: bytes) -> None:
        with refusing():
            meta, _, _ = unpack(f"stream {self.model}", blob)
        self.initialise(meta["values"])
        self._plant.restore(meta["plant"])
        self._encoder.n_draws, self._x_meas = meta["n_draws"], meta["x_meas"]
