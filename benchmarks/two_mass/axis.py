"""A drive of two masses with its cascaded position loop, and its nonlinearities, as plain numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

__all__ = ["Axis", "Friction", "LinearLoop"]


@dataclass(frozen=True)
class LinearLoop:
    """Motor and load in a P position and a PI or P velocity loop; forces are per kg of the drive as it starts.

    ``F_demand = K_p (K_v (x_d − x) + ff ẋ_d − v_motor) + I``, ``İ = F_demand's bracket · K_p / T_i``,
    ``τ Ḟ = F_demand − F``.

    Attributes
    ----------
    load : float
        Share of the mass beyond the belt or screw.
    added : float
        Mass that the load has more than that, relative to the whole drive.
    stiffness, damping : float, 1/s² and 1/s
        Of the belt or screw.
    viscous : float, 1/s
        Friction of each body, linear in its velocity.
    k_v, k_p : float, 1/s
        Gains of the position and of the velocity loop.
    t_i : float, s
        Integral time of the velocity loop; 0: none.
    feedforward : float
        Of the velocity, 0 … 1.
    tau : float, s
        Lag of the motor's force.
    at_load : bool
        Whether the encoder is at the load.
    closed_at_load : bool
        Whether the position loop is closed there.
    """

    load: float
    stiffness: float
    damping: float
    viscous: float
    k_v: float
    k_p: float
    t_i: float
    feedforward: float
    tau: float
    at_load: bool
    closed_at_load: bool
    added: float = 0.0

    @property
    def demand(self) -> Array:
        """Motor force demanded by states, command and slope, ``(8,)``."""
        row = np.zeros(8)
        row[2 if self.closed_at_load else 0] = -self.k_p * self.k_v
        row[1], row[4] = -self.k_p, 1.0
        row[6:] = self.k_p * self.k_v, self.k_p * self.feedforward
        return row

    def slower(self, factor: float) -> LinearLoop:
        """Return the same drive with gains lower by a factor below 1."""
        return replace(self, k_p=factor * self.k_p, k_v=factor * self.k_v, t_i=self.t_i / factor)

    def matrices(self) -> tuple[Array, Array]:
        """Return ``A``, ``(6, 6)``, and ``B``, ``(6, 5)``, as drive.c has states and inputs."""
        A, B = np.zeros((6, 6)), np.zeros((6, 5))
        motor, load = 1.0 - self.load, self.load + self.added
        spring = np.array([self.stiffness, self.damping, -self.stiffness, -self.damping])
        A[0, 1] = A[2, 3] = 1.0
        A[1, :4], A[3, :4] = -spring / motor, spring / load
        A[1, 1] -= self.viscous / motor
        A[3, 3] -= self.viscous / load
        A[1, 5] = 1.0 / motor
        B[1, 2], B[3, 3] = -1.0 / motor, -1.0 / load
        A[5], B[5, :2] = self.demand[:6] / self.tau, self.demand[6:] / self.tau
        A[5, 5] -= 1.0 / self.tau
        B[5, 4] = -1.0 / self.tau
        if self.t_i:
            A[4], B[4, :2] = self.demand[:6] / self.t_i, self.demand[6:] / self.t_i
            A[4, 4] = 0.0
            B[4, 4] = -1.0 / self.t_i  # no windup beyond the motor's limit
        return A, B

    @property
    def output(self) -> Array:
        """Row of the states that the encoder measures, ``(6,)``."""
        return np.asarray(np.eye(6)[2 if self.at_load else 0])

    @property
    def _states(self) -> list[int]:
        """States that there are: without integral action the fifth is none."""
        return [0, 1, 2, 3, 4, 5] if self.t_i else [0, 1, 2, 3, 5]

    @property
    def least_damping(self) -> float:
        """Least damping ratio of a pole; negative where the loop is unstable."""
        poles = np.linalg.eigvals(self.matrices()[0][np.ix_(self._states, self._states)])
        return float(np.min(-poles.real / np.abs(poles)))

    @property
    def model(self) -> ModalModel:
        """The loop from ``x_d`` to the encoder as eq. (15), the feedforward as a derivative of ``x_d``."""
        import control  # takes a second to load

        kept = self._states
        A, B = self.matrices()
        A, B, c = A[np.ix_(kept, kept)], B[kept], self.output[kept]
        # c (sI − A)⁻¹ s b = c (sI − A)⁻¹ A b + c b, and c b = 0
        b = B[:, 0] + A @ B[:, 1]
        return ModalModel.from_control(control.ss(A, b[:, None], c[None, :], [[0.0]]))


@dataclass(frozen=True)
class Friction:
    """LuGre friction of a body.

    Attributes
    ----------
    coulomb : float, m/s²
        Sliding friction, per kg of the drive; 0: none.
    stribeck : float
        Static friction relative to it.
    v_stribeck : float, m/s
    presliding : float, m
        Deflection of the bristles when sliding.
    micro_damping : float, 1/s
        Damping of the bristles at rest.
    """

    coulomb: float = 0.0
    stribeck: float = 1.0
    v_stribeck: float = 1e-3
    presliding: float = 1e-5
    micro_damping: float = 0.0

    @property
    def bristle(self) -> float:
        """Stiffness of the bristles, 1/s²."""
        return self.coulomb / self.presliding


@dataclass(frozen=True)
class Axis:
    """A drive with its nonlinearities.

    Attributes
    ----------
    loop : LinearLoop
    changed : LinearLoop
        From sample ``change_at`` on.
    change_at : int
    motor, bearing : Friction
        Of the motor and of the load.
    play : float, m
        Backlash of belt or screw.
    cogging, cogging_period, cogging_phase : float; m/s², m, rad
        Ripple of the motor's force.
    lead, lead_period, lead_phase : float; m, m, rad
        Amplitude, period and phase of the screw's or pulley's error at the encoder.
    force_max : float, m/s²
        Largest motor force.
    dead_time : int
        Samples until a command arrives.
    interpolates : bool
        Whether the drive runs in a straight line from one command to the next, a sample late.
    T_s : float, s
        Sampling interval.
    """

    loop: LinearLoop
    changed: LinearLoop
    change_at: int
    T_s: float
    motor: Friction = Friction()
    bearing: Friction = Friction()
    play: float = 0.0
    cogging: float = 0.0
    cogging_period: float = 1.0
    cogging_phase: float = 0.0
    lead: float = 0.0
    lead_period: float = 1.0
    lead_phase: float = 0.0
    force_max: float = 1e9
    dead_time: int = 0
    interpolates: bool = False

    def linear(self) -> Axis:
        """Return the drive without its nonlinearities."""
        free = Friction()
        return replace(self, motor=free, bearing=free, play=0.0, cogging=0.0, lead=0.0, force_max=1e9)

    @property
    def text(self) -> str:
        """Description."""
        loop = self.loop
        f_locked = np.sqrt(loop.stiffness / loop.load) / (2 * np.pi)
        parts = [
            f"P/{'PI' if loop.t_i else 'P'} {loop.k_v:.3g}, {loop.k_p:.3g} 1/s, feedforward {loop.feedforward:.2g}",
            f"load {loop.load:.2g} on {f_locked:.3g} Hz",
            f"encoder at the {'load' if loop.at_load else 'motor'}",
        ]
        if self.changed != loop:
            parts.append(f"load + {self.changed.added:.2g} from {self.change_at * self.T_s:.2g} s")
        for name, friction in (("motor", self.motor), ("load", self.bearing)):
            if friction.coulomb:
                parts.append(
                    f"friction of the {name} {friction.coulomb:.2g} m/s², {1e6 * friction.presliding:.2g} µm presliding"
                )
        for name, size in (("backlash", self.play), ("lead error", self.lead)):
            if size:
                parts.append(f"{name} {1e6 * size:.3g} µm")
        if self.cogging:
            parts.append(f"cogging {self.cogging:.2g} m/s²")
        parts.append(f"dead time {self.dead_time}" + ", interpolated" * self.interpolates)
        return ", ".join(parts)
