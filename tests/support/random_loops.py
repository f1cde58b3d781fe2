"""Closed loops with random parameters of the compensator: the library's and the C core's, each with its own drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from c_core import COMPENSATOR, DESCRIPTIONS, TS, CModel, library_compensator
from numpy.typing import NDArray

from hybridsep.cosim.library import LibraryController, LibraryDrive
from hybridsep.cosim.loop import Controller, record
from hybridsep.cosim.run import COMPENSATOR as COMPENSATOR_KIND
from hybridsep.machine import load_machine
from hybridsep.plants.encoder import Encoder
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest

Array = NDArray[np.float64]

MACHINES = ("spring_mass_damper", "als25010_x", "als25010_y")

LIMITS = {"trajectory": (0.08, 8.0, 1000.0), "drive": (0.1, 16.0, 5000.0)}
"""v_max, a_max and j_max: those of the trajectory, so that nearly every plan is bounded, and the usual ones."""

for _name in MACHINES:
    DESCRIPTIONS[f"compensator_{_name}"] = {
        "model": "SepCompensator",
        "parameters": COMPENSATOR,
        "modes": [
            {"f_n": mode.f_n, "zeta": mode.zeta, "alpha": mode.alpha, "beta": mode.beta}
            for mode in load_machine(_name).model.modes
        ],
    }


@dataclass(frozen=True)
class Loop:
    """One closed loop.

    Attributes
    ----------
    machine : str
    values : dict
        FMI parameters of the compensator.
    r : (n,) array, m
        Commanded positions, as they enter the look-ahead; they begin at the position of rest.
    noise_seed : int
        Of the encoder.
    """

    machine: str
    values: dict[str, Any]
    r: Array
    noise_seed: int

    @property
    def model(self) -> str:
        """Key of :data:`c_core.DESCRIPTIONS`."""
        return f"compensator_{self.machine}"

    def drive(self) -> LibraryDrive:
        """Return the plant and its encoder."""
        machine = load_machine(self.machine)
        assert machine.plant is not None
        return LibraryDrive(machine.new_plant(), Encoder(machine.plant.noise_std, self.noise_seed))


def random_loop(seed: int, n: int = 2500, machine: str | None = None, **fixed: float) -> Loop:
    """Return a loop whose parameters follow from a seed, ``n`` samples long.

    Parameters
    ----------
    seed : int
    n : int
        Samples.
    machine : str, optional
        Random too if left out.
    **fixed
        Parameters that are not random.
    """
    rng = np.random.default_rng(seed)
    drawn = MACHINES[rng.integers(3)]
    Np = int(rng.choice([20, 24, 30, 40, 50, 60, 80, 100]))
    spacing = int(rng.choice([s for s in (1, 2, 3, 4, 5, 8, 10) if Np % s == 0]))
    least = Np + 4 * spacing + 3
    values: dict[str, Any] = {
        "Np": Np,
        "spacing": spacing,
        "preview": int(rng.integers(least, max(least + 1, 260))),
        "p": int(rng.integers(1, min(Np, 60) + 1)),
        "q": int(rng.integers(0, min(Np, 45))),
        "lambda": float(10 ** rng.uniform(-12, -6)),
    }
    chosen = (LIMITS["trajectory"], LIMITS["drive"], None)[rng.integers(3)]
    if chosen is None:
        v_max, a_max, j_max = np.array(LIMITS["trajectory"]) * rng.uniform(1, 3, 3)
        chosen = float(v_max), float(a_max), float(j_max)
    values |= dict(zip(("v_max", "a_max", "j_max"), chosen, strict=True))
    values |= {
        "change_max": float(rng.choice([1e-4, 2e-4, 5e-4, 1e-3, 5e-3])),
        "jerk_weight": float(10 ** rng.uniform(-2, 2.5)),
        "v_friction": float(rng.choice([0.0, 1e-3, 2e-3, 5e-3])),
        "no_reversal": int(rng.integers(2)),
        "t_init": float(rng.choice([0.0, 0.05, 0.1, 0.3])),
    }
    stops = np.cumsum(np.concatenate(([0.0], rng.uniform(-0.01, 0.01, 30))))
    r = rest_to_rest(stops, PAPER_LIMITS, TS, dwell=float(rng.uniform(0, 0.3)))[:n]
    start = float(rng.choice([0.0, 0.1]))
    return Loop(machine or drawn, {**COMPENSATOR, **values, **fixed}, r + start, int(rng.integers(1000)))


class CController:
    """The C core's compensator in the loop.

    Parameters
    ----------
    loop : Loop
    perturbation : float
        Largest relative change of its two inputs, random.
    """

    name, kind, T_s = "the C core", COMPENSATOR_KIND, TS

    def __init__(self, loop: Loop, perturbation: float = 0.0) -> None:
        self.loop = loop
        self.Np: int = loop.values["Np"]
        self.delay: int = loop.values["preview"]
        self.factors = 1.0 + perturbation * np.random.default_rng(0).uniform(-1, 1, (len(loop.r), 2))

    def initialise(self, start: float) -> None:
        """Begin at rest at ``start``, m."""
        self.model = CModel(self.loop.model, {**self.loop.values, "x_d_ahead": start, "x_meas": start}).initialise()

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of a compensator's outputs, m, and its state."""
        return tuple(self.model[name] for name in self.kind.outputs), int(self.model["sep_state"])

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, changed by its factors."""
        inputs = np.array([x_d_ahead, x_meas]) * self.factors[k]
        self.model["x_d_ahead"], self.model["x_meas"] = inputs.tolist()
        self.model.step(k * TS, TS)


def run_library(loop: Loop) -> tuple[Array, NDArray[np.int64]]:
    """Return ``x_dm``, m, and ``sep_state`` of every sample with the library's compensator, ``(n,)`` both."""
    compensator = library_compensator(loop.values, loop.model, float(loop.r[0]))
    return _run(LibraryController(compensator, None), loop)


def run_c(loop: Loop, perturbation: float = 0.0) -> tuple[Array, NDArray[np.int64]]:
    """Return the same with the C core's; ``perturbation``: largest relative change of its two inputs, random."""
    return _run(CController(loop, perturbation), loop)


def _run(controller: Controller, loop: Loop) -> tuple[Array, NDArray[np.int64]]:
    """Return command and state of every sample, the fill included."""
    drive = loop.drive()
    start = float(loop.r[0])
    controller.initialise(start)
    drive.initialise(start)
    signals, state = record(controller, drive, loop.r, len(loop.r))
    return signals["x_dm"], state
