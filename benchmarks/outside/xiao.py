"""A published machine tool: a circle in a tilted plane, four passes, from the numbers of its printed table.

    python -m benchmarks.outside.xiao [--picture FILE] [--noise SEED]      (three minutes)

Q. Xiao, M. Wan, X. Qin, "Pre-compensation of friction for CNC machine tools through constructing a nonlinear model
predictive scheme", Chinese Journal of Mechanical Engineering 36:119 (2023): Table 1 has inertia, gains and Stribeck
friction of three axes, each a proportional position loop around a proportional-integral velocity loop, with velocity
feed-forward. Own writing from the table. The circle's radius and feed are the ones with which the axes' contour error
without compensation is the printed one, 67.3 µm at most and 22.3 µm RMS; the paper's own method leaves 20.9 and 6.6.

Contour errors of the true positions, µm, without the first and the last 2 % of each pass. Passes follow without a stop.
A pass has 9780 samples, more than ``recall`` holds by default; *remembers a pass*: twice as many. *From the gains*: the
physics model is the linear loop of the table; *from fit*: of a log of other motions, on which ``hybridsep.fit`` trains.
The limits of the drive are estimates of that log. Learning control is norm-optimal, with a Q filter.
"""

import argparse
import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from benchmarks.learning_control import learned_commands
from benchmarks.outside.controller import Controller
from hybridsep.base.metrics import ErrorSize
from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.fitting.fit import fit
from hybridsep.fitting.limits import estimated_limits
from hybridsep.fitting.replay import Recording
from hybridsep.fitting.result import Fit
from hybridsep.identify.model import machine_of
from hybridsep.machines.machine import Machine
from hybridsep.model.physics import ModalModel
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.predict.predictor import HybridPredictor

T_S, NP, NOISE_STD, PASSES = 1e-3, 100, 1e-7, 4
RADIUS, FEED, TURNS = 10e-3, 1.25 / 60.0, 3  # of the circle, m and m/s, and how often each pass goes round it

PLANE = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])
"""Two directions that span the circle's plane, to which all three axes are inclined alike."""

UM = 1e6


class Friction(NamedTuple):
    """Stribeck friction in one direction, as a control signal, V, at velocities in rad/s."""

    static: float
    coulomb: float
    static_fades: float
    coulomb_rises: float

    def at(self, speed: float) -> float:
        """Return the size of the friction at a speed ≥ 0, rad/s."""
        fades, rises = math.exp(-speed / self.static_fades), math.exp(-speed / self.coulomb_rises)
        return self.static * fades + self.coulomb * (1.0 - rises)


@dataclass(frozen=True)
class Axis:
    """Row of the table."""

    travel: float  # mm/rad, of the table for an angle of the motor
    inertia: float  # kg m²
    viscous: float  # N m s/rad
    position_gain: float  # rad/s per mm
    velocity_gain: float  # V s/rad
    integral_time: float  # s
    forward: Friction
    backward: Friction
    torque_gain: float = 3.1201 * 0.8910  # N m/V: the amplifier's A/V times the motor's N m/A
    feed_forward: float = 1.0

    def model(self) -> ModalModel:
        """Return the linear loop, the axis without friction."""
        s = control.tf("s")
        velocity = self.velocity_gain * (1 + 1 / (self.integral_time * s))
        motor = self.torque_gain / (self.inertia * s + self.viscous)
        inner = velocity * motor / (1 + velocity * motor)
        position = self.position_gain * self.travel
        outer = inner * (position + self.feed_forward * s) / (s + inner * position)
        return ModalModel.from_control(control.minreal(outer, verbose=False))


AXES = {
    "X": Axis(
        *(1.5915, 3.3177e-3, 0.0192, 102.2, 0.1846, 0.12),
        Friction(0.6481, 0.5326, 0.8227, 0.8227),
        Friction(0.8235, 0.6459, 0.6357, 0.6357),
    ),
    "Y": Axis(
        *(1.5915, 3.8650e-3, 0.0219, 102.2, 0.2151, 0.12),
        Friction(0.8187, 0.6949, 0.5890, 0.5890),
        Friction(0.9065, 0.8740, 1.2170, 2.2011),
    ),
    "Z": Axis(
        *(6.3662, 15.974e-3, 0.0041, 50.0, 0.3500, 0.12),
        Friction(1.0412, 0.9599, 0.6615, 0.6907),
        Friction(0.2210, 0.1606, 2.1453, 2.8072),
    ),
}


class XiaoDrive:
    """Axis of the table as a plant of the library, whose command runs straight from sample to sample."""

    _STEPS = 20  # a sample

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self.reset()

    def reset(self, start: float = 0.0) -> None:
        """Reset to rest at ``start``, m."""
        self._position = self._command = 1e3 * start  # mm
        self._speed = self._integral = 0.0  # rad/s, and of the velocity's error over the integral time

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h``, s, while the command goes to ``x_d``, m."""
        axis, dt = self._axis, h / self._STEPS
        before, after = self._command, 1e3 * x_d
        ahead, impulse = axis.feed_forward * (after - before) / h / axis.travel, dt / axis.inertia
        for i in range(1, self._STEPS + 1):
            command = before + (after - before) * i / self._STEPS
            error = axis.position_gain * (command - self._position) + ahead - self._speed
            self._integral += error * dt / axis.integral_time
            torque = axis.torque_gain * axis.velocity_gain * (error + self._integral)
            speed = self._speed + impulse * (torque - axis.viscous * self._speed)
            # friction takes off as much as it can, and holds what is slower than that
            if speed > 0.0:
                speed = max(0.0, speed - impulse * axis.torque_gain * axis.forward.at(speed))
            else:
                speed = min(0.0, speed + impulse * axis.torque_gain * axis.backward.at(-speed))
            self._position += axis.travel * dt * 0.5 * (speed + self._speed)
            self._speed = speed
        self._command = after

    @property
    def x(self) -> float:
        """True position, m."""
        return 1e-3 * self._position


def circle() -> tuple[Array, NDArray[np.bool_]]:
    """Return the commands of the axes, ``(n, 3)``, m, and which of the samples of a pass are judged, ``(n,)``."""
    along, slow = 2.0 * np.pi * RADIUS * TURNS, 1.5 * FEED  # m; time of speeding up at 1 m/s², s
    u = np.arange(0.0, 1.0, T_S / slow)
    begin = FEED * slow * (u**3 - 0.5 * u**4)
    end = along - begin[::-1]
    middle = np.linspace(begin[-1], end[0], round((end[0] - begin[-1]) / (FEED * T_S)) + 1)[1:-1]
    path = np.concatenate((np.zeros(300), begin, middle, end, np.full(400, along)))
    angle = path / RADIUS
    points = RADIUS * np.stack((np.cos(angle), np.sin(angle)), axis=1) @ PLANE
    return points, (path > 0.02 * along) & (path < 0.98 * along)


def contour_errors(points: Array) -> Array:
    """Return how far points ``(n, 3)``, m, are from the circle, ``(n,)``, m."""
    a, b = PLANE @ points.T
    return np.asarray(np.hypot(np.hypot(a, b) - RADIUS, np.cross(*PLANE) @ points.T))


def other_program(seed: int, duration: float = 20.0) -> Array:
    """Return a log's commands, m: moves from point to point with rests, and arcs of other radii and feeds."""
    rng, pieces, x = np.random.default_rng(seed), [np.zeros(200)], 0.0
    while sum(map(len, pieces)) * T_S < duration:
        side = 1.0 if x < 0.0 else -1.0
        if rng.random() < 0.5:
            distance, v = side * rng.uniform(2e-3, 30e-3), rng.uniform(0.01, 0.08)
            u = np.linspace(0.0, 1.0, max(60, round(1.875 * abs(distance) / v / T_S)) + 1)[1:]
            pieces.append(x + distance * (10 * u**3 - 15 * u**4 + 6 * u**5))
            x += distance
            pieces.append(np.full(round(rng.uniform(0.02, 0.3) / T_S), x))
        else:
            radius, v, turns = rng.uniform(4e-3, 25e-3), rng.uniform(0.01, 0.06), rng.integers(1, 3)
            u = np.linspace(0.0, 1.0, round(2 * np.pi * turns * radius / v / T_S) + 1)[1:]
            angle = 2 * np.pi * turns * (10 * u**3 - 15 * u**4 + 6 * u**5)
            pieces.append(x + side * radius * (1.0 - np.cos(angle)))
    return np.concatenate(pieces)


def of_gains(name: str) -> Machine:
    """Return an axis with the model of its gains, and with the limits that a log of other motions gives."""
    x_d = other_program(10 + list(AXES).index(name))
    x = simulate(XiaoDrive(AXES[name]), x_d, T_S)
    limits = estimated_limits([Recording(x_d, x, len(x_d) // 2)], T_S)
    more = {"unit": "m", "predictor": {"Np": NP}, "drive_limits": limits}
    return machine_of(AXES[name].model(), "foh", T_S, f"xiao_{name.lower()}", f"Xiao, Wan, Qin 2023, {name}", **more)


def fitted(name: str, duration: float) -> Fit:
    """Return what ``hybridsep.fit`` makes of a log of an axis."""
    x_d, T = other_program(10 + list(AXES).index(name), duration), T_S
    x = Encoder(NOISE_STD, 1).measure_all(simulate(XiaoDrive(AXES[name]), x_d, T))
    return fit(x_d, x, T_s=T, unit="m", Np=NP, name=f"xiao_{name.lower()}")


def noisy(x: Array, seed: int) -> Array:
    """Return measurements of true positions, m."""
    return Encoder(NOISE_STD, 3 + seed).measure_all(x)


def passes(name: str, duration: float, noise: int) -> dict[str, Array]:
    """Return the true positions of an axis over all passes by the way it is compensated, (n,) each, m."""
    axis, found = AXES[name], fitted(name, duration)
    r = circle()[0][:, "XYZ".index(name)]

    def run(machine: Machine, compensate: str, trained: HybridPredictor | None = None) -> Array:
        controller = Controller(machine, compensate, trained)
        return cosimulate(controller, XiaoDrive(axis), np.tile(r, PASSES), encoder=Encoder(NOISE_STD, noise)).x

    gains, of_fit = (one.changed("predictor", {"recall": 2 * len(r)}) for one in (of_gains(name), found.machine))
    learning = learned_commands(axis.model(), T_S, "foh", XiaoDrive(axis), r, PASSES, noisy, cut_off=120.0)
    return {
        "off": np.tile(simulate(XiaoDrive(axis), r, T_S), PASSES),
        "physics, from the gains": run(of_gains(name), "physics"),
        "hybrid, cold, from the gains": run(of_gains(name), "hybrid"),
        "the same, which remembers a pass": run(gains, "hybrid"),
        "from fit, which remembers a pass": run(of_fit, "hybrid"),
        "and trained by fit": run(of_fit, "hybrid", found.predictor()),
        "learning control": np.concatenate([one.x for one in learning]),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="file for a picture of the last passes' contour errors")
    parser.add_argument("--log", type=float, default=20.0, metavar="S", help="duration of the logs that fit gets")
    parser.add_argument("--noise", type=int, default=2, metavar="SEED", help="of the measurements in the passes")
    options = parser.parse_args(arguments)
    points, judged = circle()
    with ProcessPoolExecutor(2) as pool:
        axes = list(pool.map(partial(passes, duration=options.log, noise=options.noise), AXES))
    print(f"{'contour error, largest / RMS, µm':34}" + "".join(f"{f'pass {i + 1}':>16}" for i in range(PASSES)))
    reached = {way: np.stack([axis[way] for axis in axes], axis=1).reshape(PASSES, -1, 3) for way in axes[0]}
    for way, each in reached.items():
        print(row(way, [contour_errors(one)[judged] for one in each]))
    print("\ntracking errors, largest / RMS, µm")
    for way, each in reached.items():
        for i, name in enumerate(AXES):
            sizes = [ErrorSize.of((points - one)[judged, i]) for one in each]
            print(
                f"{f'{way}, {name}':34}" + "".join(f"{f'{UM * e.largest:.1f} / {UM * e.rms:.1f}':>16}" for e in sizes)
            )
    if options.picture is not None:
        draw(options.picture, {way: contour_errors(each[-1])[judged] for way, each in reached.items()})


def row(head: str, errors: Sequence[Array]) -> str:
    """Return a line of errors (n,), m, one a pass."""
    sizes = map(ErrorSize.of, errors)
    return f"{head:34}" + "".join(f"{f'{UM * one.largest:.1f} / {UM * one.rms:.1f}':>16}" for one in sizes)


def draw(file: Path, errors: dict[str, Array]) -> None:
    """Draw the contour errors of a pass, m, over time."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
    shown = {
        "off": "off",
        "the same, which remembers a pass": "cold, from the gains",
        "and trained by fit": "trained by fit",
    }
    for way, label in shown.items():
        axes.plot(T_S * np.arange(len(errors[way])), UM * errors[way], label=label, linewidth=1)
    axes.set(xlabel="t [s]", ylabel="contour error [µm]", title=f"Xiao, Wan, Qin 2023, Table 1: pass {PASSES}")
    axes.legend(loc="upper center", ncols=3, bbox_to_anchor=(0.5, -0.14), frameon=False)
    figure.savefig(file, dpi=100)


if __name__ == "__main__":
    main()
