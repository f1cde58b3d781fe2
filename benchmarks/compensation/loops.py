"""Closed loops of the library over a trajectory, cold and warm, disturbed too."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from hybridsep.base.settings import Limits
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run
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


def noise_seed(seed: int, run: int) -> int:
    """Return the encoder's seed in the first, second, … run in a row."""
    return seed + 1000 * run


class LibraryLoops:
    """The library's compensator and plant, with the FMU's timing."""

    def run(
        self, machine: Machine, r: Array, compensate: str, seed: int, n: int = 1, case: Case | None = None
    ) -> list[Run]:
        """Return ``n`` runs in a row, each warm after the first.

        ``r``, (n,), m, are commanded positions; each run has another noise, by :func:`noise_seed`.
        """
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
