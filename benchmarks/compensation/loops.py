"""Closed loops over a trajectory, cold and warm: in the library, or FMU against FMU through fmpy."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hybridsep.base.settings import PARAMETERS, Limits
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.spec import fmu_names
from hybridsep.machines.machine import Machine, load_machine
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Encoder, Plant

_PAPER = {"averaging": False, "Np": 50, "p": 50, "q": 40, "lambda": 1e-8, "t_init": 0.1}


def paper_machine(name: str) -> Machine:
    """Return a bundled machine whose compensator plans with the paper's model, with the settings best for it."""
    return load_machine(name).changed("compensator", _PAPER)


@dataclass(frozen=True)
class Case:
    """Disturbance of the loop: another plant from sample ``at`` on, other measurements, limits or noise."""

    change: Callable[[FeedDrive], None] | None = None
    at: int = 3050
    held: tuple[int, int] | None = None
    outlier: tuple[int, float] | None = None
    limits: Limits | None = None
    noise: float = 1.0

    @property
    def sensor(self) -> Callable[[int, float], float] | None:
        """What becomes of the measurement; None: nothing."""
        if self.held is not None:
            return HeldSensor(*self.held)
        return None if self.outlier is None else Outlier(*self.outlier)


class Outlier:
    """Adds ``size``, m, to sample ``k``."""

    def __init__(self, k: int, size: float) -> None:
        self.k, self.size = k, size

    def __call__(self, k: int, x_meas: float) -> float:
        """Return what arrives of the measurement at sample ``k``."""
        return x_meas + (self.size if k == self.k else 0.0)


class HeldSensor:
    """Repeats the last value before sample ``first`` until sample ``last``."""

    def __init__(self, first: int, last: int) -> None:
        self.first, self.last, self.value = first, last, 0.0

    def __call__(self, k: int, x_meas: float) -> float:
        """Return what arrives of the measurement at sample ``k``."""
        if not self.first <= k < self.last:
            self.value = x_meas
        return self.value


class Loops(Protocol):
    """Runs a machine's drive behind its compensator."""

    def run(
        self, machine: Machine, r: Array, compensate: str, seed: int, n: int = 1, case: Case | None = None
    ) -> list[Run]:
        """Return ``n`` runs in a row, each warm after the first.

        Parameters
        ----------
        machine : Machine
            With the settings of its ``[compensator]``.
        r : (n,) array, m
            Commanded positions.
        compensate : {"off", "physics", "hybrid"}
            As in :class:`~hybridsep.base.settings.CompensatorSettings`.
        seed : int
            Noise seed; each run has another one, :func:`noise_seed`.
        n : int
            Runs.
        case : Case, optional
            Disturbance of the loop.
        """
        ...


def noise_seed(seed: int, run: int) -> int:
    """Return the encoder's seed in the first, second, … run in a row."""
    return seed + 1000 * run


class LibraryLoops:
    """The library's compensator and plant, with the FMU's timing."""

    def run(
        self, machine: Machine, r: Array, compensate: str, seed: int, n: int = 1, case: Case | None = None
    ) -> list[Run]:
        """Return ``n`` runs in a row; see :class:`Loops`."""
        compensator = self.compensator(machine, compensate, case or Case())
        return [self.once(compensator, machine, r, seed, i, case or Case()) for i in range(n)]

    def compensator(self, machine: Machine, compensate: str, case: Case) -> SepCompensator:
        """Return a compensator that has learned nothing."""
        settings = replace(machine.compensator_settings, compensate=compensate)
        if case.limits is not None:
            settings = replace(settings, limits=case.limits)
        return machine.new_compensator(settings)

    def once(self, compensator: SepCompensator, machine: Machine, r: Array, seed: int, run: int, case: Case) -> Run:
        """Return run number ``run`` of a compensator, warm if it is not the first."""
        assert machine.plant is not None

        def disturb(k: int, moved: Plant) -> None:
            if case.change is not None and k == case.at and isinstance(moved, FeedDrive):
                case.change(moved)

        return cosimulate(
            compensator,
            machine.new_plant(),
            r,
            encoder=Encoder(machine.plant.noise_std * case.noise, noise_seed(seed, run)),
            t_init=None if run == 0 else 0.0,
            disturb=disturb,
            sensor=case.sensor,
        )


class FmuLoops:
    """A SepCompensator FMU against a plant FMU; a warm one starts with the weights of the library's run before.

    Use it as a context manager: the FMUs are in a temporary folder.

    Attributes
    ----------
    apart : float, m
        Largest difference of ``x_dm`` from the library's cold runs so far.
    """

    def __init__(self) -> None:
        self.apart = 0.0
        self._folder = tempfile.TemporaryDirectory()
        self._built: dict[tuple[str, ...], Path] = {}
        self._library = LibraryLoops()

    def __enter__(self) -> FmuLoops:
        return self

    def __exit__(self, *error: object) -> None:
        self._folder.cleanup()

    def run(
        self, machine: Machine, r: Array, compensate: str, seed: int, n: int = 1, case: Case | None = None
    ) -> list[Run]:
        """Return ``n`` ≤ 2 runs in a row; see :class:`Loops`.

        Raises
        ------
        ValueError
            If the case changes the plant in mid-run: an FMU's parameters are fixed then.
        """
        case = case or Case()
        if case.change is not None or n > 2:
            raise ValueError("FMUs can be run twice in a row, and their plant cannot change in mid-run")
        cold = self._once(machine, r, compensate, seed, 0, case, self._fmu(machine, "SepCompensator"))
        compensator = self._library.compensator(machine, compensate, case)
        same = self._library.once(compensator, machine, r, seed, 0, case)
        self.apart = max(self.apart, float(np.max(np.abs(cold.x_dm - same.x_dm))))
        if n == 1:
            return [cold]
        weights = Path(self._folder.name) / "trained.state"
        compensator.predictor.save(weights)
        trained = self._fmu(machine, "SepCompensator", weights)
        return [cold, self._once(machine, r, compensate, seed, 1, case, trained)]

    def _once(self, machine: Machine, r: Array, compensate: str, seed: int, run: int, case: Case, fmu: Path) -> Run:
        assert machine.plant is not None
        values: dict[str, Any] = {"compensate": PARAMETERS["compensate"].to_fmi(compensate)}
        if case.limits is not None:
            limits = case.limits
            values |= {"v_max": limits.velocity, "a_max": limits.acceleration, "j_max": limits.jerk}
        plant = {"seed": noise_seed(seed, run), "noise_std": machine.plant.noise_std * case.noise}
        return cosimulate(
            fmu,
            self._fmu(machine, "FeedDrive"),
            r,
            controller_values=values,
            plant_values=plant,
            sensor=case.sensor,
        )

    def _fmu(self, machine: Machine, model: str, weights: Path | None = None) -> Path:
        """Return an FMU of a machine; only those with weights are built anew."""
        key = (machine.name, model, str(machine.compensator))
        if weights is not None or key not in self._built:
            name = next(name for name, built in fmu_names(machine).items() if built == model)
            folder = Path(self._folder.name) / ("warm" if weights else str(len(self._built)))
            path = build_fmu(machine, name, folder, targets=("host",), weights=weights)
            if weights is not None:
                return path
            self._built[key] = path
        return self._built[key]
