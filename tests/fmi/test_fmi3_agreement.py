"""FMI 3.0 FMUs against their FMI 2.0 twins: the same outputs bit for bit, and the same states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from built_once import FMI3, NATIVE, BuiltFmus, each_kind

from hybridsep import build_fmu, cosimulate, load_machine, staircase
from hybridsep.base.errors import FmuError
from hybridsep.cosim.fmu import FmuInstance

PAIRS = dict(zip(FMI3, NATIVE, strict=True))


def reader(fmu: FmuInstance) -> Callable[[], bytes]:
    """Return a function that gives all outputs and locals bit by bit, samples of windows one by one."""
    shown = [v for v in fmu.variables.values() if v.causality in ("output", "local")]
    reals = fmu.reader([v.name for v in shown if v.type in ("Real", "Float64")])
    others = [v.name for v in shown if v.type not in ("Real", "Float64")]
    return lambda: np.array(reals()).tobytes() + bytes(str([int(fmu.get(name)) for name in others]), "ascii")


@pytest.fixture
def twins(request: pytest.FixtureRequest, fmus: BuiltFmus) -> Iterator[tuple[FmuInstance, FmuInstance]]:
    """An FMI 3.0 FMU and its FMI 2.0 twin."""
    with FmuInstance(fmus(request.param)) as new, FmuInstance(fmus(PAIRS[request.param])) as old:
        yield new, old


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
@pytest.mark.parametrize("twins", each_kind(FMI3), indirect=True)
def test_all_values_are_the_same_bit_for_bit(twins: tuple[FmuInstance, FmuInstance]) -> None:
    new, old = twins
    assert reader(new)() == reader(old)()
    for fmu in twins:
        fmu.initialise()
    assert reader(new)() == reader(old)()
    rows = drive(new, range(700))
    assert len(set(rows)) > 100
    assert rows == drive(old, range(700))


@pytest.mark.slow
def test_a_whole_closed_loop_is_the_same_bit_for_bit(fmus: BuiltFmus) -> None:
    runs = [
        cosimulate(fmus(f"SepCompensator{suffix}"), fmus(f"FeedDrive{suffix}"), staircase()) for suffix in ("Fmi3", "")
    ]
    signals = ("x_dm", "x_d", "x_pb", "x_h", "x", "x_meas", "state")
    new, old = ([getattr(run, name).tobytes() for name in signals] for run in runs)
    assert new == old


@pytest.mark.slow
@pytest.mark.parametrize("twins", ["HybridPredictorFmi3", "SepCompensatorFmi3", "FeedDriveFmi3"], indirect=True)
def test_a_state_saved_between_two_samples_goes_on_as_the_twin_does(twins: tuple[FmuInstance, FmuInstance]) -> None:
    """Steps of 0.3 T_s, so that the state is saved and restored in mid-sample."""
    rows = []
    for fmu in twins:
        fmu.initialise()
        before = drive(fmu, range(1000), 3e-4)
        blob = fmu.save()
        after = drive(fmu, range(1000, 1800), 3e-4)
        fmu.restore(blob)
        assert drive(fmu, range(1000, 1800), 3e-4) == after
        with FmuInstance(fmu.path) as other:
            other.restore(blob)
            assert drive(other, range(1000, 1800), 3e-4) == after
        rows.append((before, after))
    assert rows[0] == rows[1]


def test_states_of_the_two_are_not_mixed_up(fmus: BuiltFmus) -> None:
    with FmuInstance(fmus("FeedDriveFmi3")) as new, FmuInstance(fmus("FeedDrive")) as old:
        for one, other in ((new, old), (old, new)):
            one.initialise()
            with pytest.raises(FmuError, match="it belongs to another FMU: the GUID differs"):
                other.restore(one.save())


def test_only_the_python_flavour_has_no_fmi_3(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    with pytest.raises(FmuError, match="FMUs of the Python flavour are of FMI 2 alone, as pythonfmu's are, got FMI 3"):
        build_fmu(machine, "FeedDrivePy", tmp_path, "python", fmi="3")
    with pytest.raises(FmuError, match="the version of FMI must be one of 2, 3, got '1'"):
        build_fmu(machine, "FeedDrive", tmp_path, fmi="1")
