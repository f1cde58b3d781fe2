"""Closed loops with random parameters of the compensator: the library's and the C core's, each with its own drive."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from c_core import COMPENSATOR, TABLES, TS, CModel
from library_models import library_compensator, numbered
from numpy.typing import NDArray

from hybridsep.fmi.spec import table_of
from hybridsep.machines.machine import load_machine
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.plant import Drive, Encoder
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest

Array = NDArray[np.float64]

MACHINES = ("spring_mass_damper", "als25010_x", "als25010_y")

LIMITS = {"trajectory": (0.08, 8.0, 1000.0), "drive": (0.1, 16.0, 5000.0)}
"""v_max, a_max and j_max: the trajectory's, so that nearly every plan is bounded, and the usual ones."""

for _name in MACHINES:
    _table = table_of(load_machine(_name), "SepCompensator", f"compensator_{_name}")
    TABLES[_table.name] = replace(_table, parameters=COMPENSATOR)


@dataclass(frozen=True)
class Loop:
    """One closed loop."""

    machine: str
    values: dict[str, Any]  # FMI parameters of the compensator
    r: Array  # (n,), m: commanded positions, as they enter the look-ahead; they begin at the position of rest
    noise_seed: int  # of the encoder
    quantum: float = 0.0  # m: of the encoder and of the commands; 0: none

    @property
    def model(self) -> str:
        """Key of :data:`c_core.TABLES`."""
        return f"compensator_{self.machine}"

    def drive(self) -> tuple[Drive, Encoder]:
        """Return the plant, at rest at the start, and its encoder."""
        machine = load_machine(self.machine)
        assert machine.plant is not None
        plant = machine.new_plant()
        plant.reset(float(self.r[0]))
        return plant, Encoder(machine.plant.noise_std, self.noise_seed)

    def rounded(self, x: Any) -> Any:
        """Return positions, m, as numbers of quanta."""
        return self.quantum * np.round(x / self.quantum) if self.quantum else x

    def at_rest_at(self, start: float, n_rest: int) -> "Loop":
        """Return the same loop in micrometres, from another position, m, where it rests for ``n_rest`` samples."""
        loop = replace(self, quantum=1e-6)
        r = loop.rounded(self.r - self.r[0] + start)
        return replace(loop, r=np.concatenate((np.full(n_rest, r[0]), r))[: len(r)])


def random_loop(seed: int, n: int = 2500, machine: str | None = None, **fixed: float) -> Loop:
    """Return a loop whose parameters follow from a seed, ``n`` samples long.

    ``n``: samples; ``machine``: random too if left out; ``**fixed``: parameters that are not random.
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
        "no_reversal": int(rng.integers(2)),
        "t_init": float(rng.choice([0.0, 0.05, 0.1, 0.3])),
    }
    stops = np.cumsum(np.concatenate(([0.0], rng.uniform(-0.01, 0.01, 30))))
    r = rest_to_rest(stops, PAPER_LIMITS, TS, dwell=float(rng.uniform(0, 0.3)))[:n]
    start = float(rng.choice([0.0, 0.1]))
    return Loop(machine or drawn, {**COMPENSATOR, **values, **fixed}, r + start, int(rng.integers(1000)))


def run_library(loop: Loop, *, nudged: bool = False) -> tuple[Array, NDArray[np.int64]]:
    """Return ``x_dm``, m, and ``sep_state`` of every sample with the library's compensator, ``(n,)`` both.

    Where the loop is ``nudged``, the last binary place of each measured position is one more.
    """
    plant, encoder = loop.drive()
    start = float(loop.r[0])
    values = {**loop.values, **numbered(TABLES[loop.model].modes)}
    ahead = LookAhead(library_compensator(values), start)
    x_dm, states = np.empty(len(loop.r)), np.empty(len(loop.r), dtype=np.int64)
    for k, r in enumerate(loop.r):
        x_meas = float(np.nextafter(x := loop.rounded(encoder.measure(plant.x)), np.inf if nudged else x))
        x_dm[k], states[k] = ahead.x_dm, ahead.sep_state
        plant.step(ahead.x_dm, TS)
        ahead.sample(float(r), x_meas)
    return x_dm, states


def run_c(loop: Loop) -> tuple[Array, NDArray[np.int64]]:
    """Return the same with the C core's."""
    plant, encoder = loop.drive()
    start = float(loop.r[0])
    model = CModel(loop.model, {**loop.values, "x_d_ahead": start, "x_meas": start}).initialise()
    x_dm, states = np.empty(len(loop.r)), np.empty(len(loop.r), dtype=np.int64)
    for k, r in enumerate(loop.r):
        x_meas = float(loop.rounded(encoder.measure(plant.x)))
        x_dm[k], states[k] = model["x_dm"], model["sep_state"]
        plant.step(model["x_dm"], TS)
        model["x_d_ahead"], model["x_meas"] = float(r), x_meas
        model.step(k * TS, TS)
    return x_dm, states
