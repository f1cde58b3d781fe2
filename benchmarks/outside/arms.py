"""Robot arms of MuJoCo, all joints at once: tracking errors off, with both models, and of a rival.

    pip install '.[benchmark]'
    python -m benchmarks.outside.arms [ur5e panda] [--picture FILE]      (three minutes)

Multibody models that others wrote: UR5e and Panda as the package robosuite ships them (MIT licence; Y. Zhu and others,
"robosuite: A modular simulation framework and benchmark for robot learning", arXiv:2009.12293), integrated by MuJoCo
(Apache licence; E. Todorov, T. Erez, Y. Tassa, IROS 2012). Servos and friction are ours: at each joint a
proportional-derivative servo at 2 kHz, whose command arrives a sample of 500 Hz late, Coulomb and viscous friction, an
encoder of 17 bits. The Panda's gravity is compensated, as its firmware does. ``x_load``: each compensator is told, from
the multibody model, what torque the other joints, gravity and changed inertia will add.

Each joint's model is ``hybridsep.fit``'s, of 24 s of moves; then 20 s of other moves. Largest and RMS of the true
position's error, mrad. The rival is a finite impulse response with friction's sign, fitted to the same log.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.outside.controller import Controller
from hybridsep.base.metrics import ErrorSize
from hybridsep.base.signals import Array
from hybridsep.cosim.fir_inverse import FirInverse
from hybridsep.fitting.fit import fit
from hybridsep.fitting.result import Fit
from hybridsep.machines.machine import Machine

T_S, NP, RESOLUTION = 2e-3, 50, 2 * np.pi / 2**17
LOG, TEST = 24.0, 20.0  # durations of the log and of the test, s

WAYS = ("off", "physics", "hybrid, cold", "hybrid, warm", "cold, x_load", "warm, x_load", "FIR inverse")
MRAD = 1e3


@dataclass(frozen=True)
class Joint:
    """Servo and friction of a joint, and where and how fast it moves."""

    stiffness: float  # N m/rad
    damping: float  # N m s/rad
    armature: float  # kg m², of the motor at the joint
    friction: float  # N m
    viscous: float  # N m s/rad
    torque: float  # N m, largest
    start: float  # rad
    lowest: float  # rad
    highest: float  # rad
    velocity: float  # rad/s
    acceleration: float  # rad/s²


@dataclass(frozen=True)
class Arm:
    """Arm: its joints, and whether its gravity is compensated."""

    joints: tuple[Joint, ...]
    weightless: bool


ARMS = {
    "ur5e": Arm(
        (
            Joint(2000, 100, 1.0, 6.0, 8.0, 150, -1.57, -2.6, -0.5, 1.2, 5),
            Joint(2000, 100, 1.0, 6.0, 8.0, 150, -1.2, -1.9, -0.5, 1.2, 5),
            Joint(2000, 100, 0.6, 4.0, 5.0, 150, 1.4, 0.6, 2.2, 1.5, 6),
            Joint(500, 25, 0.15, 1.2, 1.5, 28, -1.57, -2.4, -0.8, 2.0, 10),
            Joint(500, 25, 0.15, 1.2, 1.5, 28, -1.57, -2.4, -0.8, 2.0, 10),
            Joint(500, 25, 0.15, 1.0, 1.5, 28, 0.0, -1.5, 1.5, 2.0, 10),
        ),
        weightless=False,
    ),
    "panda": Arm(
        (
            Joint(4500, 225, 0.6, 1.5, 2.0, 174, 0.0, -1.2, 1.2, 1.4, 6),
            Joint(4500, 225, 0.6, 1.5, 2.0, 174, -0.3, -1.0, 0.6, 1.4, 5),
            Joint(3500, 175, 0.5, 1.2, 2.0, 174, 0.0, -1.0, 1.0, 1.4, 6),
            Joint(3500, 175, 0.5, 1.2, 2.0, 174, -2.0, -2.6, -1.0, 1.4, 6),
            Joint(2000, 100, 0.25, 0.8, 1.0, 24, 0.0, -1.2, 1.2, 1.8, 9),
            Joint(2000, 100, 0.25, 0.6, 1.0, 24, 1.8, 0.9, 2.9, 1.8, 9),
            Joint(2000, 100, 0.2, 0.5, 1.0, 24, 0.8, -0.6, 2.0, 1.8, 9),
        ),
        weightless=True,
    ),
}


class ArmInMujoco:
    """Arm with its servos."""

    _STEPS = 4  # a sample

    def __init__(self, name: str) -> None:
        import mujoco

        self._mujoco, arm = mujoco, ARMS[name]
        package = find_spec("robosuite")  # which is not imported: it would load a graphics library
        assert package is not None
        assert package.origin is not None
        file = Path(package.origin).parent / "models/assets/robots" / name / "robot.xml"
        spec = mujoco.MjSpec.from_file(str(file))
        for group in (spec.geoms, spec.meshes, spec.actuators, spec.sensors):
            for one in list(group):
                spec.delete(one)
        self._model: Any = spec.compile()
        model = self._model
        model.opt.timestep, model.opt.integrator = T_S / self._STEPS, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model.jnt_limited[:] = 0
        model.dof_armature[:], model.dof_frictionloss[:], model.dof_damping[:], self._kp, self._kd, self._most = (
            np.array([getattr(joint, of) for joint in arm.joints])
            for of in ("armature", "friction", "viscous", "stiffness", "damping", "torque")
        )
        if arm.weightless:
            model.opt.gravity[:] = 0.0
        self._data = mujoco.MjData(model)

    def reset(self, start: Array) -> None:
        """Reset to rest at commanded positions, ``(n,)``, rad, where the servos hold the arm after 3 s."""
        self._mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:] = self._late = start
        for _ in range(round(3.0 / T_S)):
            self.step(start)

    def step(self, commands: Array) -> None:
        """Advance by a sample, while the servos get the commands of the sample before, ``(n,)``, rad."""
        data, held, self._late = self._data, self._late, np.array(commands)
        for _ in range(self._STEPS):
            torque = self._kp * (held - data.qpos) - self._kd * data.qvel
            data.qfrc_applied[:] = np.clip(torque, -self._most, self._most)
            self._mujoco.mj_step(self._model, data)

    def load(self, commands: Array) -> Array:
        """Return the torques on joints but for their own inertia's, over stiffness, ``(n, joints)``, rad."""
        model, data, torque = self._model, self._mujoco.MjData(self._model), np.empty_like(commands)
        velocity = np.gradient(commands, T_S, axis=0)
        acceleration = np.gradient(velocity, T_S, axis=0)
        for k, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(
            zip(commands, velocity, acceleration, strict=True)
        ):
            self._mujoco.mj_fwdPosition(model, data)
            self._mujoco.mj_fwdVelocity(model, data)
            self._mujoco.mj_rne(model, data, 1, torque[k])
        inertia = np.sum(torque * acceleration, axis=0) / np.sum(acceleration**2, axis=0)
        return np.asarray((inertia * acceleration - torque) / self._kp)

    @property
    def x(self) -> Array:
        """True positions, ``(n,)``, rad."""
        return np.array(self._data.qpos)


def moves(arm: Arm, seed: int, duration: float) -> Array:
    """Return commands of synchronous moves, each joint at 50 to 100 % of its speed, ``(n, joints)``, rad."""
    rng = np.random.default_rng(seed)
    start, lowest, highest, v_max, a_max = (
        np.array([getattr(joint, of) for joint in arm.joints])
        for of in ("start", "lowest", "highest", "velocity", "acceleration")
    )
    pieces, n = [np.tile(start, (100, 1))], round(duration / T_S)
    while sum(map(len, pieces)) < n:
        begin, time, share = pieces[-1][-1], rng.uniform(0.8, 1.6), rng.uniform(0.5, 1.0, len(start))
        # of the quintic: largest velocity 15/8, largest acceleration 10/√3, of distance 1 in time 1
        distance = share * np.minimum(v_max * time / 1.875, a_max * time**2 / 5.774)
        side = rng.choice((-1.0, 1.0), len(start))
        leaves = (begin + side * distance < lowest) | (begin + side * distance > highest)
        goal = np.clip(begin + np.where(leaves, -side, side) * distance, lowest, highest)
        u = np.arange(1, round(time / T_S) + 1)[:, None] / round(time / T_S)
        pieces.append(begin + (goal - begin) * (10 * u**3 - 15 * u**4 + 6 * u**5))
        pieces.append(np.tile(goal, (round(rng.uniform(0.0, 0.4) / T_S), 1)))
    commands = np.concatenate(pieces[:-2])  # a move that there is no time for is left out: programs end at rest
    return np.pad(commands, ((0, n - len(commands)), (0, 0)), mode="edge")


def measured(x: Array) -> Array:
    """Return what the encoders show, rad."""
    return RESOLUTION * np.round(x / RESOLUTION)


def played(arm: ArmInMujoco, commands: Array) -> Array:
    """Return the true positions under commands, ``(n, joints)``, rad."""
    arm.reset(commands[0])
    x = np.empty_like(commands)
    for k, command in enumerate(commands):
        x[k] = arm.x
        arm.step(command)
    return x


def compensated(arm: ArmInMujoco, r: Array, controllers: Sequence[Controller], load: Array | None = None) -> Array:
    """Return the true positions with a controller at each joint, which may know its load, ``(n, joints)``, rad."""
    arm.reset(r[0])
    delay = max(one.delay for one in controllers)
    for one, start in zip(controllers, r[0].tolist(), strict=True):
        one.restart(start)
    # commands arrive a sample late, loads do not
    given = np.stack((r, np.zeros_like(r) if load is None else np.vstack((load[1:], load[-1:]))), axis=1)
    ahead = np.concatenate((given, np.tile(given[-1], (delay, 1, 1))))
    x, x_dm = np.empty((len(ahead), r.shape[1])), r[0]
    for k, (wanted, torques) in enumerate(ahead):
        x[k] = arm.x
        arm.step(x_dm)
        each = zip(controllers, wanted.tolist(), measured(x[k]).tolist(), torques.tolist(), strict=True)
        x_dm = np.array([one.step(*inputs) for one, *inputs in each])
    return x[delay:]


def fitted(columns: tuple[Array, Array]) -> Fit:
    """Return what ``hybridsep.fit`` makes of a joint's commands and measured positions, (n,) each, rad."""
    x_d, x = columns
    return fit(x_d, x, T_s=T_S, unit="rad", Np=NP)


def limited(machine: Machine, joint: Joint, preview: int) -> Machine:
    """Return a joint's machine with the drive's limits, of which a log shows a part, and the look-ahead of all."""
    found = machine.table["drive_limits"]
    known = {"velocity": 2 * joint.velocity, "acceleration": 5 * joint.acceleration, "jerk": 300 * joint.acceleration}
    return machine.changed("", {"drive_limits": {**found, **known}}).changed("compensator", {"preview": preview})


def errors(name: str) -> dict[str, Array]:
    """Return the errors by the way an arm is compensated, ``(n, joints)`` each, rad."""
    arm, plant = ARMS[name], ArmInMujoco(name)
    x_d, r = moves(arm, 1, LOG), moves(arm, 77, TEST)
    x = measured(played(plant, x_d))
    joints = list(zip(x_d.T, x.T, strict=True))
    with ProcessPoolExecutor(2) as pool:
        fits = list(pool.map(fitted, joints))

    preview = max(one.machine.compensator_settings.preview or 0 for one in fits)  # joints that move together

    def controllers(compensate: str, *, warm: bool = False) -> list[Controller]:
        return [
            Controller(limited(one.machine, joint, preview), compensate, one.predictor() if warm else None)
            for one, joint in zip(fits, arm.joints, strict=True)
        ]

    rivals = [FirInverse.fitted([one], NP) for one in joints]
    commands = [rival.command(wanted) for rival, wanted in zip(rivals, r.T, strict=True) if rival is not None]
    load = plant.load(r)
    reached = (
        played(plant, r),
        compensated(plant, r, controllers("physics")),
        compensated(plant, r, controllers("hybrid")),
        compensated(plant, r, controllers("hybrid", warm=True)),
        compensated(plant, r, controllers("hybrid"), load),
        compensated(plant, r, controllers("hybrid", warm=True), load),
        played(plant, np.stack(commands, axis=1)),
    )
    return {way: r - one for way, one in zip(WAYS, reached, strict=True)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", default=list(ARMS), help="names")
    parser.add_argument("--picture", type=Path, help="file for a picture of all joints' RMS")
    options = parser.parse_args(arguments)
    sizes: dict[str, list[ErrorSize]] = {way: [] for way in WAYS}
    labels: list[str] = []
    print(f"{'largest / RMS, mrad':24}" + "".join(f"{way:>18}" for way in WAYS))
    for name in options.arms:
        found = errors(name)
        for i in range(len(ARMS[name].joints)):
            labels.append(f"{name} {i + 1}")
            for way in WAYS:
                sizes[way].append(ErrorSize.of(found[way][:, i]))
            cells = (f"{MRAD * sizes[way][-1].largest:.3g} / {MRAD * sizes[way][-1].rms:.3g}" for way in WAYS)
            print(f"{labels[-1]:24}" + "".join(f"{cell:>18}" for cell in cells), flush=True)
    if options.picture is not None:
        draw(options.picture, labels, {way: [MRAD * one.rms for one in each] for way, each in sizes.items()})


def draw(file: Path, labels: Sequence[str], sizes: dict[str, list[float]]) -> None:
    """Draw the RMS errors of all joints, mrad."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
    for marker, (way, each) in zip("os^v<>x", sizes.items(), strict=True):
        axes.semilogy(range(len(labels)), each, marker, label=way)
    axes.set_xticks(range(len(labels)), labels, rotation=45)
    axes.set(ylabel="tracking error, RMS [mrad]")
    axes.grid(alpha=0.3)
    figure.legend(ncols=4, loc="outside upper center")
    figure.savefig(file, dpi=100)


if __name__ == "__main__":
    main()
