"""FMI 3.0 FMUs against their FMI 2.0 twins: the same outputs bit for bit, and the same states."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from built_once import BuiltFmus

from hybridsep import staircase
from hybridsep.base.errors import FmuError
from hybridsep.cosim.fmu import FmuInstance


def reader(fmu: FmuInstance) -> Callable[[], bytes]:
    """Return a function that gives all outputs and locals bit by bit, samples of windows one by one."""
    shown = [v for v in fmu.variables.values() if v.causality in ("output", "local")]
    reals = fmu.reader([v.name for v in shown if v.type in ("Real", "Float64")])
    others = [v.name for v in shown if v.type not in ("Real", "Float64")]
    return lambda: np.array(reals()).tobytes() + bytes(str([int(fmu.get(name)) for name in others]), "ascii")


def drive(fmu: FmuInstance, steps: Sequence[int], h: float = 1e-3) -> list[bytes]:
    """Step through a motion with noise of its own; return all values at each of the steps."""
    inputs = [name for name, v in fmu.variables.items() if v.causality == "input" and v.type in ("Real", "Float64")]
    command, values, rows = staircase(), reader(fmu), []
    for k in steps:
        for i, name in enumerate(inputs):
            fmu.set(name, float(command[max(0, k - 100 * i)]) + 1e-6 * ((k * 7919 + i) % 101 - 50))
        fmu.step(k * h, h)
        rows.append(values())
    return rows


@pytest.mark.slow
@pytest.mark.parametrize("name", ["HybridPredictor", "SepCompensator", "FeedDrive", "ReferenceTrajectory"])
def test_all_values_are_the_same_bit_for_bit(fmus: BuiltFmus, name: str) -> None:
    """In steps of 0.3 T_s, so that a state is saved and restored in mid-sample, in the same or another instance."""
    rows, blobs = [], []
    for suffix in ("", "Fmi3"):
        with FmuInstance(fmus(f"{name}{suffix}")) as fmu, FmuInstance(fmu.path) as other:
            before = [reader(fmu)()]
            fmu.initialise()
            before += [reader(fmu)(), *drive(fmu, range(1000), 3e-4)]
            blob = fmu.save()
            after = drive(fmu, range(1000, 1800), 3e-4)
            for each in (fmu, other):
                each.restore(blob)
                assert drive(each, range(1000, 1800), 3e-4) == after
        rows.append((before, after))
        blobs.append(blob)
    assert rows[0] == rows[1]
    assert len(set(rows[0][0])) > 100 or name == "ReferenceTrajectory"
    with FmuInstance(fmus(name)) as old, pytest.raises(FmuError, match="another FMU: the GUID differs"):
        old.restore(blobs[1])
