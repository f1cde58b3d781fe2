"""Rotary axis on a belt, with gravity, cogging and friction before sliding: a program of a pick-and-place cell.

    python -m benchmarks.outside.belt [--Np 60]      (two minutes)

Motor and arm are two masses, the belt a spring and damper between them; the drive's cascade sees only the motor, a log
the arm. Friction is the LuGre model (C. Canudas de Wit and others, IEEE Trans. Autom. Control 40, 1995); the motor cogs
200 and 100 times a turn; the weight changes with the angle. Nothing of it is a plant of the library. The model is
``hybridsep.fit``'s of a minute of the program, the test 20 s of another one. Largest and RMS of the arm's error, mdeg;
the rival is a finite impulse response with friction's sign, fitted to the same log and inverted.
"""

import argparse
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.outside.controller import Controller
from hybridsep.base.metrics import ErrorSize
from hybridsep.base.signals import Array
from hybridsep.cosim.fir_inverse import FirInverse, PlayedCommand
from hybridsep.cosim.loop import cosimulate
from hybridsep.fitting.fit import fit
from hybridsep.machines.machine import Machine
from hybridsep.plants.plant import simulate
from hybridsep.predict.predictor import HybridPredictor

T_S, ENCODER = 1e-3, 2 * math.pi / 2**18  # sampling interval, s, and step of the arm's encoder, rad
V_MAX, A_MAX, J_MAX = 9.0, 300.0, 2e4  # of the drive, rad/s and so on: 1.3, 4 and 14 times the program's

MDEG = 1e3 * 180 / math.pi


class BeltAxis:
    """The axis as a plant of the library; angles in rad where that has m."""

    _STEPS, _SETTLING = 20, 3000

    def __init__(self) -> None:
        self.reset()

    def reset(self, start: float = 0.0) -> None:
        """Reset to rest at a commanded angle, rad, where the drive holds the arm after 3 s."""
        self._motor = self._arm = self._command = self._seen = start
        self._motor_speed = self._arm_speed = self._bristles = 0.0
        self._torque = self._torque_late = self._integral = self._speed_seen = 0.0
        for _ in range(self._SETTLING):
            self.step(start, T_S)

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h``, s, with the command ``x_d``, rad."""
        # the drive: motor's encoder of 20 bits, filtered speed, feed-forward of 0.7; its torque acts a sample late
        bits = 2 * math.pi / 2**20
        seen = bits * round(self._motor / bits)
        self._speed_seen += 0.6 * ((seen - self._seen) / h - self._speed_seen)
        error = 0.7 * (x_d - self._command) / h + 25.0 * (x_d - seen) - self._speed_seen
        wanted = 1.6 * error + self._integral
        if abs(wanted) <= 15.0:
            self._integral += 1.6 / 0.06 * error * h
        held, self._torque_late = self._torque_late, min(15.0, max(-15.0, wanted))
        self._seen, self._command = seen, x_d
        dt = h / self._STEPS
        for _ in range(self._STEPS):
            self._torque += dt / 0.0005 * (held - self._torque)
            sliding = 0.25 + 0.11 * math.exp(-((self._arm_speed / 0.05) ** 2))
            rate = self._arm_speed - 700.0 * abs(self._arm_speed) / sliding * self._bristles
            friction = 700.0 * self._bristles + rate + 0.05 * self._arm_speed
            belt = 967.0 * (self._motor - self._arm) + 0.35 * (self._motor_speed - self._arm_speed)
            cogging = 0.08 * math.sin(200 * self._motor) + 0.024 * math.sin(100 * self._motor + 0.7)
            self._motor_speed += dt / 0.005 * (self._torque - belt - cogging - 0.02 * self._motor_speed)
            self._arm_speed += dt / 0.02 * (belt - friction - math.cos(self._arm))
            self._motor += dt * self._motor_speed
            self._arm += dt * self._arm_speed
            self._bristles += dt * rate

    @property
    def x(self) -> float:
        """True angle of the arm, rad."""
        return self._arm


def shown(_k: int, x: float) -> float:
    """Return what the arm's encoder shows, rad."""
    return ENCODER * math.floor(x / ENCODER + 0.5)


def move(begin: float, end: float, v: float) -> Array:
    """Return a move from rest to rest, degrees, within ``v`` °/s, 4000 °/s² and 80 000 °/s³."""
    distance = abs(end - begin)
    v = min(v, math.sqrt(4000 * distance))
    shape = np.ones(1)
    for time in (distance / v, v / 4000, 4000 / 80_000):
        n = max(1, math.ceil(time / T_S))
        shape = np.convolve(shape, np.full(n, 1 / n))
    return np.asarray(begin + (end - begin) * np.cumsum(shape))


def program(seed: int, duration: float) -> Array:
    """Return commands, rad: pick at 10°, place in one of six slots, 25° back slowly, now and then a check at 200°."""
    rng, at, pieces = np.random.default_rng(seed), 10.0, [np.full(600, 10.0)]
    while sum(map(len, pieces)) * T_S < duration:
        slot = 96 + 8.8 * rng.integers(6)
        goals = [(slot, 400, 0.35), (slot - 25, 120, 0.05), (10.0, 400, 0.30)]
        if rng.random() < 0.25:
            goals.insert(1, (200.0, 300, 0.5))
        if rng.random() < 0.2:
            goals += [(4.0, 20, 0.2), (10.0, 20, 0.15)]
        for goal, v, rest in goals:
            pieces.append(move(at, goal, v * rng.choice([1, 1, 0.7])))
            pieces.append(np.full(round((rest + 0.2 * rng.random()) / T_S), goal))
            at = goal
    return np.asarray(np.radians(np.concatenate(pieces)[: round(duration / T_S)]))


def part() -> Array:
    """Return the commands of one part, rad."""
    goals = [(131.2, 400, 300), (106.2, 120, 80), (10.0, 400, 300), (4.0, 20, 150), (10.0, 20, 250)]
    at, pieces = 10.0, [np.full(200, 10.0)]
    for goal, v, rest in goals:
        pieces += [move(at, goal, v), np.full(rest, goal)]
        at = goal
    return np.asarray(np.radians(np.concatenate(pieces)))


def fitted(Np: int, duration: float, look_ahead: float | None = None) -> tuple[Machine, HybridPredictor, FirInverse]:
    """Return what ``hybridsep.fit`` makes of a log of the program, and the rival."""
    x_d = program(0, duration)
    x = np.array([shown(0, one) for one in simulate(BeltAxis(), x_d, T_S).tolist()])
    how: dict[str, Any] = {"v_max": V_MAX, "a_max": A_MAX, "j_max": J_MAX, "look_ahead": look_ahead}
    found = fit(x_d, x, T_s=T_S, unit="rad", Np=Np, name="belt", **how)
    rival = FirInverse.fitted([(x_d, x)], Np)
    assert rival is not None
    return found.machine, found.predictor(), rival


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--Np", type=int, default=60, help="samples of the look-ahead")
    parser.add_argument("--log", type=float, default=60.0, metavar="S", help="duration of the log that fit gets")
    parser.add_argument("--look-ahead", type=float, metavar="S", help="that the compensator has, too")
    options = parser.parse_args(arguments)
    machine, trained, rival = fitted(options.Np, options.log, options.look_ahead)
    r = program(1, 20.0)

    def run(compensate: str, predictor: HybridPredictor | None = None) -> Array:
        return cosimulate(Controller(machine, compensate, predictor), BeltAxis(), r, sensor=shown).x

    reached = {
        "off": cosimulate(PlayedCommand(r, T_S), BeltAxis(), r).x,
        "physics": run("physics"),
        "hybrid, cold": run("hybrid"),
        "hybrid, warm": run("hybrid", trained),
        "FIR inverse": cosimulate(PlayedCommand(rival.command(r), T_S), BeltAxis(), r).x,
    }
    print(f"{'mdeg':14}{'largest':>10}{'RMS':>10}")
    for way, x in reached.items():
        size = ErrorSize.of(r - x)
        print(f"{way:14}{MDEG * size.largest:10.1f}{MDEG * size.rms:10.1f}")


if __name__ == "__main__":
    main()
