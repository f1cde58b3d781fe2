"""Gains of a loop: the physics model that they make, in machine files and fits, and what a log says of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Run
from quick_fits import without_larger_structures

import hybridsep
from benchmarks.outside.xiao import AXES, T_S, XiaoDrive, other_program
from hybridsep.base.errors import ParameterError
from hybridsep.base.settings import Cascade
from hybridsep.base.signals import Array
from hybridsep.identify.operation import identify_operation
from hybridsep.machines.machine import load_machine, machine_from_table
from hybridsep.model.physics import ModalModel


def gains(name: str) -> dict[str, float]:
    axis = AXES[name]
    Kv = axis.velocity_gain * axis.torque_gain
    inner = {"inertia": axis.inertia, "Kv": Kv, "Tv": axis.integral_time, "viscous": axis.viscous}
    return {**inner, "Kp": axis.position_gain * axis.travel, "feed_forward": axis.feed_forward}


@pytest.fixture(scope="module")
def log() -> tuple[Array, Array]:
    x_d = other_program(10, 9.0)
    return x_d, hybridsep.simulate(XiaoDrive(AXES["X"]), x_d, T_S)


@pytest.mark.parametrize("name", AXES)
def test_gains_are_the_closed_loop(name: str) -> None:
    """Of a published machine: 25.3 Hz and ζ 0.479 of X."""
    omega = 2.0 * np.pi * np.geomspace(0.01, 200.0, 60)
    found = ModalModel.cascade(Cascade(**gains(name))).frequency_response(omega)
    np.testing.assert_allclose(found, AXES[name].model().frequency_response(omega), rtol=1e-9)
    table = {"name": "x", "title": "x", "T_s": 1e-3, "physics": {"cascade": gains(name)}}
    of_machine = machine_from_table(table).model.frequency_response(omega)
    np.testing.assert_allclose(of_machine, found, rtol=1e-12)


def test_without_an_integrator_and_feed_forward_it_is_one_mode() -> None:
    """EMPS, by the constants that are published with its data."""
    mass, Kp, Kv, viscous = 95.1089, 160.18, 243.45 * 35.15065188, 203.5034
    [mode] = ModalModel.cascade(Cascade(inertia=mass, Kp=Kp, Kv=Kv, viscous=viscous)).modes
    assert mode.alpha == pytest.approx(Kv * Kp / mass)
    assert abs(mode.beta) < 1e-9
    assert 2.0 * mode.zeta * mode.omega == pytest.approx((viscous + Kv) / mass)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"Kp": 0.0}, r"Kp must be 0\.001 … 1000000 1/s, got 0"),
        ({"Kv": None}, "Kv must be a number"),
        ({"Ki": 1.0}, "cascade has inertia, Kp, Kv, Tv, feed_forward, viscous, got 'Ki'"),
        ({"feed_forward": 3.0}, "feed_forward must be 0 … 2"),
    ],
)
def test_gains_that_cannot_be(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        hybridsep.fit(None, cascade={**gains("X"), **changed})  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_gains_on_the_command_line(hybridsep: Run, log: tuple[Array, Array], tmp_path: Path) -> None:
    rows = np.column_stack(log)[:3000]
    np.savetxt(tmp_path / "x.csv", rows, delimiter=",", header="x_d [m],x [m]", comments="")

    command = ("fit", tmp_path / "x.csv", "--T_s", T_S, "--out", tmp_path / "fit", "--json", "--cascade")
    for given, message in (
        ("Kp=10", "inertia must be a number, got None; Kv must be a number, got None"),
        ("Kp=10,Kv", "--cascade must be NAME=VALUE with commas, each a number, got 'Kp=10,Kv'"),
    ):
        assert message in " ".join(hybridsep.refused(*command, given).split())
    hybridsep.done(*command, ",".join(f"{gain} = {value}" for gain, value in gains("X").items()))
    modes = load_machine(tmp_path / "fit" / "machine.toml").model.modes
    assert [mode.f_n for mode in modes] == pytest.approx([25.26, 1.325], rel=1e-3)


@pytest.mark.slow
def test_a_loop_that_friction_hides_is_said_not_to_be_identified(
    log: tuple[Array, Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    without_larger_structures(monkeypatch)
    x_d, x = log
    found = identify_operation([(x_d, x)], T_S)
    assert [one for one in found.findings if one.startswith("the loop is not identified: of a servo error of ")]
    linear = ModalModel.spring_mass_damper(1.0, 100.0, 15_000.0).discretise(T_S, "foh")
    clean = identify_operation([(x_d, linear.forced_response(linear.rest(), x_d)[0])], T_S)
    assert not any("not identified" in one for one in clean.findings)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_fit_of_given_gains(log: tuple[Array, Array]) -> None:
    """The model is theirs whatever the log says, and the log's word on them is a finding."""
    x_d, x = log
    found = hybridsep.fit(x_d, x, T_s=T_S, Np=50, cascade=gains("X"))
    assert [mode.f_n for mode in found.machine.model.modes] == pytest.approx([25.26, 1.325], rel=1e-3)
    said = found.identification.findings[0]
    assert said.startswith("the given gains leave ")
    assert "contradicts" not in said
    assert found.judged.replay.rms()[2] < 0.6 * found.judged.replay.rms()[0]
    others = {"Kp": 30.0, "feed_forward": 0.0}
    wrong = hybridsep.fit(x_d[:3000], x[:3000], T_s=T_S, Np=50, cascade=gains("X") | others)
    assert wrong.identification.findings[0].endswith(": the log contradicts them")
