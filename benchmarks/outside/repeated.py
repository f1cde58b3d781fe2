"""The same part ten times in a row: no pass is to be worse than one before, beside learning control.

    python -m benchmarks.outside.repeated [belt xiao stage] [--recall N]      (five minutes)

Largest and RMS of the true position's error, pass by pass, without a stop between them, of the hybrid that begins cold:
the axis on a belt, the X axis of Xiao's machine, the stage with friction on its actual velocity. Learning control is
norm-optimal with a Q filter, from the command as it is, with the weight and the filter that are best for its last pass.
The hybrid's errors are split: what was predicted and left is the plan's, what was not predicted the model's.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.averaging import circle, with_friction_on
from benchmarks.learning_control import learned_commands
from benchmarks.outside import belt, xiao
from benchmarks.outside.controller import Controller
from hybridsep.base.metrics import ErrorSize
from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.machines.machine import Machine, load_machine
from hybridsep.plants.plant import Encoder, Plant, simulate

PASSES = 10
WEIGHTS, CUT_OFFS = (0.1, 0.01), (15.0, 50.0)
"""Of learning control: relative to the square of the model's gain at rest; Hz."""


@dataclass(frozen=True)
class Part:
    """A part and its drive."""

    name: str
    unit: str  # in which errors are shown
    scale: float  # of it in one m, or rad
    machine: Machine
    plant: Plant
    r: Array  # (n,) commands of one pass, m
    noise_std: float = 0.0  # m
    sensor: Callable[[int, float], float] | None = None

    def measured(self, x: Array, seed: int) -> Array:
        """Return what is measured of true positions, (n,), m."""
        noisy = Encoder(self.noise_std, seed).measure_all(x)
        return noisy if self.sensor is None else np.array([self.sensor(0, one) for one in noisy.tolist()])


def belt_part() -> Part:
    """Return the part of the axis on a belt, with the model of half a minute of its program."""
    machine, *_ = belt.fitted(60, 30.0)
    return Part("belt axis", "mdeg", belt.MDEG, machine, belt.BeltAxis(), belt.part(), 0.0, belt.shown)


def xiao_part() -> Part:
    """Return a pass of Xiao's X axis, with the model of its gains."""
    plant, r = xiao.XiaoDrive(xiao.AXES["X"]), xiao.circle()[0][:, 0]
    return Part("Xiao, X", "µm", 1e6, xiao.of_gains("X"), plant, r, xiao.NOISE_STD)


def stage_part() -> Part:
    """Return three circles of the stage's X axis, whose friction follows the motion."""
    machine = with_friction_on(load_machine("als25010_x"), "motion")
    assert machine.plant is not None
    plant, noise_std = machine.new_plant(), machine.plant.noise_std
    return Part("stage X, friction on the motion", "µm", 1e6, machine, plant, circle()[0], noise_std)


PARTS: dict[str, Callable[[], Part]] = {"belt": belt_part, "xiao": xiao_part, "stage": stage_part}


def controlled(part: Part) -> list[Array]:
    """Return the errors of learning control, pass by pass, (n,) each, m."""
    machine, best = part.machine, list[Array]()
    for weight, cut_off in product(WEIGHTS, CUT_OFFS):
        passes = learned_commands(
            *(machine.model, machine.T_s, machine.physics.input_hold, part.plant, part.r, PASSES, part.measured),
            weight=weight,
            cut_off=cut_off,
        )
        errors = [part.r - one.x for one in passes]
        if not best or ErrorSize.of(errors[-1]).rms < ErrorSize.of(best[-1]).rms:
            best = errors
    return best


def rows(part: Part) -> Iterator[str]:
    """Yield the lines of a part."""

    def line(head: str, errors: Sequence[Array]) -> str:
        sizes = map(ErrorSize.of, errors)
        return f"{head:18}" + "".join(
            f"{f'{part.scale * one.largest:.3g} / {part.scale * one.rms:.3g}':>15}" for one in sizes
        )

    n = len(part.r)
    yield f"{part.name}, {n} samples, largest / RMS, {part.unit}"
    yield line("off", [part.r - simulate(part.plant, part.r, part.machine.T_s)])
    controller = Controller(part.machine)
    encoder = Encoder(part.noise_std, 1)
    run = cosimulate(controller, part.plant, np.tile(part.r, PASSES), encoder=encoder, sensor=part.sensor)
    x_h = np.array(controller.x_h)[controller.delay - 1 : -1]
    yield line("hybrid, cold", list((run.x_d - run.x).reshape(PASSES, n)))
    yield line(" predicted, left", list((run.x_d - x_h).reshape(PASSES, n)))
    yield line(" not predicted", list((x_h - run.x).reshape(PASSES, n)))
    yield line("learning control", controlled(part))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", default=list(PARTS), help="names")
    parser.add_argument("--recall", type=int, help="samples that are remembered, in place of the default")
    options = parser.parse_args(arguments)
    for name in options.parts:
        part = PARTS[name]()
        if options.recall is not None:
            part = replace(part, machine=part.machine.changed("predictor", {"recall": options.recall}))
        for line in rows(part):
            print(line, flush=True)


if __name__ == "__main__":
    main()
