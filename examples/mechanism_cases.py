"""Disturbances of section 3.1 of the paper, and what past residuals leave open of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mechanism import (
    Disturbance,
    Drive,
    characteristic,
    coulomb,
    innovation,
    linear_mode,
    polynomial,
    quadratic,
    recursion_with_mode,
    simulate,
    sinusoid,
    split,
    squared_command,
)

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.trajectory import staircase


@dataclass(frozen=True)
class Case:
    """One disturbance and how much of its residual ``order`` past residuals leave open; all in metres.

    ``closed_form_error`` is the largest difference of the simulated residual from eq. (10); ``n_spikes`` counts the
    samples whose innovation exceeds 1e-9 of the largest residual, far above rounding.
    """

    name: str
    order: int
    residual_rms: float
    closed_form_error: float
    innovation_rms: float
    innovation_max: float
    n_spikes: int


def demonstrate(n: int = 2000, T_s: float = 1e-3) -> tuple[Case, ...]:
    """Run the paper's drive with each kind of ``h``, along a 10 mm, 2 Hz raised cosine of ``n`` samples.

    First the paper's ``x_d²``, there and along the staircase, with ``Γ`` of a force of −1000 N/m² · ``x_d²``; then
    those that its Remark allows.
    """
    drive = Drive.spring_mass_damper(T_s=T_s)
    squaring = replace(drive, Gamma=-1000.0 * drive.Gamma)
    t = T_s * np.arange(n)
    x_d = 0.005 * (1 - np.cos(2 * np.pi * 2.0 * t))
    mode = ModalModel([Mode(60.0, 0.02, 300.0 * (2 * np.pi * 60.0) ** 2)]).discretise(T_s)
    chi = characteristic(drive.A)
    # x_d² of a raised cosine is a constant and sinusoids of once and twice its frequency
    eta = np.convolve(polynomial(0), np.convolve(sinusoid(2.0, T_s), sinusoid(4.0, T_s)))
    r, s = recursion_with_mode(drive, mode)

    def ripple(k: int, *_: object) -> float:
        return float(np.sin(14 * np.pi * t[k]))

    def case(
        name: str,
        disturbance: Disturbance,
        recursion: Array,
        *,
        of: Drive = drive,
        along: Array = x_d,
        of_x_pb: Array | None = None,
    ) -> Case:
        run = simulate(of, along, disturbance)
        known = None if of_x_pb is None else np.convolve(of_x_pb, run.x_pb)[:n]
        news = np.abs(innovation(run.e_pb, recursion, known))
        return Case(
            name=name,
            order=len(recursion) - 1,
            residual_rms=rms(run.e_pb),
            closed_form_error=float(np.max(np.abs(run.e_pb - split(of, along, run.h)[1]))),
            innovation_rms=rms(news),
            innovation_max=float(np.max(news)),
            n_spikes=int(np.sum(news > 1e-9 * np.max(np.abs(run.e_pb)))),
        )

    friction, curve = coulomb(2.0, x_d), quadratic(drive, 100.0, 1000.0)
    # A jerk-limited move is piecewise cubic, its square piecewise of degree 6
    piecewise, stairs = np.convolve(chi, polynomial(6)), staircase(T_s)[:n]
    return (
        case("x_d², η alone (the paper)", squared_command, eta, of=squaring),
        case("x_d², η and χ", squared_command, np.convolve(chi, eta), of=squaring),
        case("x_d², staircase", squared_command, piecewise, of=squaring, along=stairs),
        case("Coulomb friction", friction, np.convolve(chi, polynomial(0))),
        case("sinusoid of time", ripple, np.convolve(chi, sinusoid(7.0, T_s))),
        case("mode, its order left out", linear_mode(drive, mode), chi),
        case("mode, with past x_pb", linear_mode(drive, mode), r, of_x_pb=s),
        *(case(f"quadratic, η of degree {d}", curve, np.convolve(chi, polynomial(d))) for d in range(3)),
    )
