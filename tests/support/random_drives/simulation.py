"""Simulation of many drives at once, exact for the linear part.

Every operation is an elementary one (+, −, ×, /, comparison, rounding) on one element per drive, so that the result of
a drive is the same to the last bit whichever others are simulated with it.
"""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from scipy.linalg import expm

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from random_drives.commands import T_S
from random_drives.disturbances import Disturbances

SUB_STEPS = 8  # internal steps in a sampling interval
H = T_S / SUB_STEPS  # s

MODES_MAX = 4
CUBIC_MAX = 2.0
"""Ranges from the centre beyond which the cubic stiffness is constant, so that no resonance can make it unbounded."""


def simulate(
    models: Sequence[ModalModel], disturbances: Sequence[Disturbances], commands: Sequence[Array]
) -> list[Array]:
    """Return the true positions of drives at rest at their first command.

    ``models``, ``disturbances``: sequences of m ModalModel and Disturbances: linear parts, of at most 4 modes, and
    nonlinearities; ``commands``: sequence of m (n_i,), m: held over each millisecond. As many are returned.
    """
    n = max(len(command) for command in commands)
    u = np.zeros((n, len(commands)))
    for i, command in enumerate(commands):
        u[: len(command), i] = command - command[0]
        u[len(command) :, i] = command[-1] - command[0]
    names = [field.name for field in fields(Disturbances)]
    values = {name: np.array([getattr(one, name) for one in disturbances]) for name in names}
    start = values["play_start"] / 2
    u = _after_play(u, values["command_play"], start) + _drift(n, values)
    x = _after_play(_motion(models, values, u), values["play"], start)
    return [command[0] + x[: len(command), i] for i, command in enumerate(commands)]


def _drift(n: int, values: dict[str, Array]) -> Array:
    """Return the thermal drift, ``(n, m)``, m."""
    # A vector function's last bit may depend on the place in the vector.
    decay = np.array([[float(np.exp(-T_S / time_constant))] for time_constant in values["time_constant"]])
    powers = np.cumprod(np.broadcast_to(decay, (len(decay), n)), axis=1).T
    return np.asarray(values["drift"] * (1 - powers))


def _after_play(x: Array, width: Array, start: Array) -> Array:
    """Return positions after a backlash, ``(n, m)``, m, from 0 on."""
    if not width.any():
        return x
    half, y = width / 2, start * width
    after = np.empty_like(x)
    for k in range(len(x)):
        y = np.minimum(np.maximum(y, x[k] - half), x[k] + half)
        after[k] = y
    return np.asarray(after - start * width)


def _motion(models: Sequence[ModalModel], values: dict[str, Array], u: Array) -> Array:
    """Return the positions before ``u(k)`` acts, ``(n, m)``, m."""
    n, m = u.shape
    tables = zip(*(_tables(model, H) for model in models), strict=True)
    A, B, command, force = (np.stack(parts, axis=-1) for parts in tables)  # (2, 2, 4, m), …
    # First the response to the command, then that to the nonlinearities: (2, 4, m) each.
    C = np.stack((command, np.where(values["at_command"] > 0, command, force)))
    c_1, c_2 = np.ascontiguousarray(C[:, 0]), np.ascontiguousarray(C[:, 1])
    z_1, z_2 = np.zeros((2, MODES_MAX, m)), np.zeros((2, MODES_MAX, m))
    inputs = np.zeros((2, 1, m))
    offsets = _Offsets(values)
    x, x_last = np.zeros(m), np.zeros(m)
    out = np.empty((n, m))
    for k in range(n):
        out[k] = x
        inputs[0, 0] = u[k]
        for _ in range(SUB_STEPS):
            inputs[1, 0] = offsets.step(x, x - x_last)
            x_last = x
            z_1, z_2 = A[0, 0] * z_1 + A[0, 1] * z_2 + B[0] * inputs, A[1, 0] * z_1 + A[1, 1] * z_2 + B[1] * inputs
            y = c_1 * z_1 + c_2 * z_2
            # The sum over modes, in an order that does not depend on the shape
            pair = y[0] + y[1]
            pair = pair[:2] + pair[2:]
            x = pair[0] + pair[1]
    return out


def _tables(model: ModalModel, h: float) -> tuple[Array, Array, Array, Array]:
    """Return the exact step by ``h``, s, of each mode, and its outputs."""
    # Returns A, (2, 2, 4); B, (2, 4); command, (2, 4): output weights of the response to the command;
    # force, (2, 4): of that to a force at the tool: every mode in phase, without zeros, static gain 1
    A, b, c = model.state_space()
    step, gain = np.zeros((2, 2, MODES_MAX)), np.zeros((2, MODES_MAX))
    command, force = np.zeros((2, MODES_MAX)), np.zeros((2, MODES_MAX))
    for i in range(len(b) // 2):
        block = slice(2 * i, 2 * i + 2)
        augmented = np.zeros((3, 3))
        augmented[:2, :2], augmented[:2, 2] = A[block, block] * h, b[block] * h
        exponential = expm(augmented)
        step[:, :, i], gain[:, i] = exponential[:2, :2], exponential[:2, 2]
        command[:, i] = c[block]
        force[0, i] = abs(c[2 * i])
    return step, gain, command, force / force.sum()


class _Offsets:
    """Friction, cubic stiffness and cogging as an offset of the command, ``(m,)``, m, in steps."""

    # Each is taken half a step ahead of the position, which is the mean over the step that it is held for: a stiffness
    # held from the position before would act as negative damping

    def __init__(self, values: dict[str, Array]) -> None:
        self.v = values
        self.stiffness = values["coulomb"] / values["presliding"]
        self.excess = values["static"] - 1
        self.per_stribeck = 1 / (H * values["v_stribeck"])
        self.per_range, self.per_pitch = 1 / values["range"], 1 / values["pitch"]
        self.bristle = values["bristle"] * values["presliding"]
        rest = np.zeros_like(self.bristle)
        # At rest the drive is in equilibrium.
        self.at_rest = rest
        self.at_rest = self.step(rest, rest)

    def step(self, x: Array, dx: Array) -> Array:
        """Return minus the offset over the next step, of positions and last displacements, ``(m,)``, m."""
        # Stribeck: the bristle's limit falls from static to sliding friction.
        speed = dx * self.per_stribeck
        limit = self.v["presliding"] * (1 + self.excess / (1 + speed * speed))
        # Dahl: dz/dx = 1 − z sign(dx)/limit, implicit in the decay, which keeps |z| ≤ limit.
        self.bristle = (self.bristle + dx) / (1 + np.abs(dx) / limit)
        half = dx / 2
        bristle = (self.bristle + half) / (1 + np.abs(half) / limit)
        ahead = x + half
        y = (ahead - self.v["centre"]) * self.per_range
        y = np.minimum(np.maximum(y, -CUBIC_MAX), CUBIC_MAX)
        offset = self.stiffness * bristle
        offset += self.v["cubic"] * (y * y * y)
        offset += self.v["cogging"] * _sine(ahead * self.per_pitch + self.v["phase"])
        return np.asarray(-offset - self.at_rest)


def _sine(turns: Array) -> Array:
    """Return a sine to 0.1 % from elementary operations: parabolas, corrected."""
    r = turns - np.rint(turns)
    y = 8 * r - 16 * r * np.abs(r)
    return np.asarray(y * (0.775 + 0.225 * np.abs(y)))
