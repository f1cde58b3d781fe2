"""Random drives of two masses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.random_drives.draws import Draws
from benchmarks.two_mass.axis import Axis, Friction, LinearLoop
from hybridsep.base.signals import Array

__all__ = ["LEAST_DAMPING", "RATES", "Encoder", "Machine", "random_axis", "random_machine"]

RATES = (250, 500, 1000, 2000, 4000, 8000)
"""Sampling rates, Hz."""

LEAST_DAMPING = 0.03
"""Least damping ratio of a loop: slower gains are taken until it is reached."""


@dataclass(frozen=True)
class Encoder:
    """Position sensor: a resolution, m, and white noise of a standard deviation, m."""

    bits: int
    quantum: float
    noise_std: float


@dataclass(frozen=True)
class Machine:
    """Belt or screw, its length a turn, m, fastest velocity, m/s, sampling interval, s, and encoder."""

    belt: bool
    turn: float
    fastest: float
    T_s: float
    encoder: Encoder


def random_machine(draws: Draws) -> Machine:
    """Return a belt or screw with an encoder of 12 to 20 bits a turn, half of them 12."""
    belt = draws.chance(0.5)
    turn = draws.log_uniform(0.05, 0.2) if belt else draws.log_uniform(0.004, 0.02)
    fastest = draws.log_uniform(0.2, 1.5) if belt else draws.log_uniform(0.05, 0.4)
    bits = 12 if draws.chance(0.5) else draws.whole(13, 20)
    quantum = turn / 2**bits
    noise_std = max(2e-8, quantum * draws.log_uniform(0.05, 1.0))
    return Machine(belt, turn, fastest, 1.0 / draws.choice(RATES), Encoder(bits, quantum, noise_std))


def random_axis(draws: Draws, machine: Machine, x_d: Array) -> Axis:
    """Return a random drive that follows a command, (n,), m, with force to spare."""
    T_s = machine.T_s
    loop = _random_loop(draws, machine)
    changed, change_at = loop, len(x_d)
    if draws.chance(0.35):
        changed = replace(loop, added=loop.load * draws.choice((-0.5, 0.5, 1.0)) * draws.uniform(0.4, 1.0))
        change_at = round(draws.uniform(0.25, 0.75) * len(x_d))
    while min(loop.least_damping, changed.least_damping) < LEAST_DAMPING:
        loop, changed = loop.slower(0.85), changed.slower(0.85)
    motor, bearing = _random_friction(draws, 0.85), _random_friction(draws, 0.7)
    acceleration = np.abs(np.diff(x_d, 2)).max() / T_s**2
    needed = acceleration * (1.0 + max(0.0, changed.added)) + motor.coulomb + bearing.coulomb
    values: dict[str, float] = {}
    if draws.chance(0.4) and bearing.coulomb and not loop.closed_at_load:  # without friction a loose load would rattle
        values["play"] = draws.log_uniform(2e-6, 1e-4)
    if draws.chance(0.3):
        period = draws.choice((1.0, 0.25)) * machine.turn
        # At most half of the loop's stiffness, so that the axis has one rest
        most = 0.5 * loop.k_p * loop.k_v * period / (2 * np.pi)
        values |= {"cogging": min(draws.log_uniform(0.02, 0.5), most), "cogging_period": period}
        values["cogging_phase"] = draws.uniform(0.0, 2 * np.pi)
    if draws.chance(0.3):
        values |= {"lead": draws.log_uniform(1e-6, 3e-5), "lead_period": machine.turn}
        values["lead_phase"] = draws.uniform(0.0, 2 * np.pi)
    return Axis(
        loop=loop,
        changed=changed,
        change_at=change_at,
        T_s=T_s,
        motor=motor,
        bearing=bearing,
        force_max=needed * draws.uniform(1.5, 3.0),
        dead_time=draws.whole(0, 3),
        interpolates=draws.chance(0.5),
        **values,
    )


def _random_loop(draws: Draws, machine: Machine) -> LinearLoop:
    """Return a loop whose velocity gain is about the frequency of the load on its belt or screw."""
    locked = draws.log_uniform(*((8.0, 60.0) if machine.belt else (30.0, 250.0)))
    omega = 2 * np.pi * min(locked, 0.3 / machine.T_s)
    load = draws.uniform(0.2, 0.8)
    stiffness, damping = load * omega**2, 2 * draws.log_uniform(0.01, 0.1) * omega * load
    k_p = omega * draws.log_uniform(0.3, 2.0)
    at_load = draws.chance(0.5)
    return LinearLoop(
        load=load,
        stiffness=stiffness,
        damping=damping,
        viscous=draws.log_uniform(0.02, 2.0),
        k_v=k_p * draws.uniform(0.1, 0.35),
        k_p=k_p,
        t_i=draws.uniform(4.0, 15.0) / k_p if draws.chance(0.55) else 0.0,
        feedforward=draws.uniform(0.5, 1.0) if draws.chance(0.4) else 0.0,
        tau=min(draws.log_uniform(1e-4, 1e-3), 0.2 / k_p),
        at_load=at_load,
        closed_at_load=at_load and draws.chance(0.4),
    )


def _random_friction(draws: Draws, share: float) -> Friction:
    """Return the friction of a body; a share of bodies has some."""
    if not draws.chance(share):
        return Friction()
    coulomb, presliding = draws.log_uniform(0.03, 1.5), draws.log_uniform(1e-6, 5e-5)
    return Friction(
        coulomb=coulomb,
        stribeck=draws.uniform(1.0, 1.6),
        v_stribeck=draws.log_uniform(5e-4, 2e-2),
        presliding=presliding,
        micro_damping=2 * draws.uniform(0.1, 0.5) * np.sqrt(coulomb / presliding),
    )
