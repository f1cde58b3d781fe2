"""A drive of two masses with its cascaded position loop, and its nonlinearities, as plain numbers."""

from dataclasses import dataclass, replace

import numpy as np
from random_drives.drive import Draws

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel


@dataclass(frozen=True)
class LinearLoop:
    """Motor and load in a P position and a PI or P velocity loop; forces are per kg of the drive as it starts.

    ``F_demand = K_p (K_v (x_d − x) + ff ẋ_d − v_motor) + I``, ``İ = F_demand's bracket · K_p / T_i``,
    ``τ Ḟ = F_demand − F``.
    """

    load: float  # share of the mass beyond the belt or screw
    # 1/s² and 1/s: of the belt or screw
    stiffness: float
    damping: float
    viscous: float  # 1/s: friction of each body, linear in its velocity
    # 1/s: gains of the position and of the velocity loop
    k_v: float
    k_p: float
    t_i: float  # s: integral time of the velocity loop; 0: none
    feedforward: float  # of the velocity, 0 … 1
    tau: float  # s: lag of the motor's force
    at_load: bool  # whether the encoder is at the load
    closed_at_load: bool  # whether the position loop is closed there
    added: float = 0.0  # mass that the load has more than that, relative to the whole drive

    @property
    def demand(self) -> Array:
        """Motor force demanded by states, command and slope, ``(8,)``."""
        row = np.zeros(8)
        row[2 if self.closed_at_load else 0] = -self.k_p * self.k_v
        row[1], row[4] = -self.k_p, 1.0
        row[6:] = self.k_p * self.k_v, self.k_p * self.feedforward
        return row

    def slower(self, factor: float) -> "LinearLoop":
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
    """LuGre friction of a body."""

    coulomb: float = 0.0  # m/s²: sliding friction, per kg of the drive; 0: none
    stribeck: float = 1.0  # static friction relative to it
    v_stribeck: float = 1e-3  # m/s
    presliding: float = 1e-5  # m: deflection of the bristles when sliding
    micro_damping: float = 0.0  # 1/s: damping of the bristles at rest

    @property
    def bristle(self) -> float:
        """Stiffness of the bristles, 1/s²."""
        return self.coulomb / self.presliding


@dataclass(frozen=True)
class Axis:
    """A drive with its nonlinearities."""

    loop: LinearLoop
    changed: LinearLoop  # from sample ``change_at`` on
    change_at: int
    T_s: float  # s: sampling interval
    # of the motor and of the load
    motor: Friction = Friction()
    bearing: Friction = Friction()
    play: float = 0.0  # m: backlash of belt or screw
    # m/s², m, rad: ripple of the motor's force
    cogging: float = 0.0
    cogging_period: float = 1.0
    cogging_phase: float = 0.0
    # m, m, rad: amplitude, period and phase of the screw's or pulley's error at the encoder
    lead: float = 0.0
    lead_period: float = 1.0
    lead_phase: float = 0.0
    force_max: float = 1e9  # m/s²: largest motor force
    dead_time: int = 0  # samples until a command arrives
    interpolates: bool = False  # whether the drive runs in a straight line from one command to the next, a sample late


RATES = (250, 500, 1000, 2000, 4000, 8000)  # sampling rates, Hz
LEAST_DAMPING = 0.03  # least damping ratio of a loop: slower gains are taken until it is reached


@dataclass(frozen=True)
class Encoder:
    """Position sensor: a resolution, m, and white noise of a standard deviation, m."""

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
    return Machine(belt, turn, fastest, 1.0 / draws.choice(RATES), Encoder(quantum, noise_std))


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
