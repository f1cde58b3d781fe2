"""Machine files: those that come with the library hold together, and bad ones are refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hybridsep import MachineError, load_machine, machine_names
from hybridsep.machine import Machine, Physics, SpringMassDamper

GOOD = """
name = "axis"
title = "An axis"
sources = ["measured"]
T_s = 0.002

[[physics.mode]]
f_n = 30.0
zeta = 0.5
alpha = 35530.0

[predictor]
Np = 50
p = 20

[plant]
kind = "stage"
f = 1e-5
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "axis.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_machines_that_come_with_the_library() -> None:
    assert machine_names() == ["als25010_x", "als25010_y", "emps", "spring_mass_damper"]
    for name in machine_names():
        machine = load_machine(name)
        assert machine.name == name
        assert machine.model.dc_gain == pytest.approx(1.0, abs=2e-6)
        assert machine.new_predictor().Ts == machine.T_s


def test_spring_mass_damper_is_a_25_hz_mode_with_5_percent_damping() -> None:
    (mode,) = load_machine("spring_mass_damper").model.modes
    assert mode.f_n == pytest.approx(25.0, rel=1e-4)
    assert mode.zeta == pytest.approx(0.05, rel=1e-3)


def test_emps_follows_from_its_published_constants() -> None:
    M, Fv, gtau, kv, kp = 95.1089, 203.5034, 35.15065188, 243.45, 160.18
    (mode,) = load_machine("emps").model.modes
    omega = np.sqrt(gtau * kv * kp / M)
    assert mode.omega == pytest.approx(omega, rel=1e-12)
    assert mode.alpha == pytest.approx(omega**2, rel=1e-12)
    assert mode.zeta == pytest.approx((Fv + gtau * kv) / M / (2 * omega), rel=1e-12)
    assert mode.beta == 0.0


def test_a_file_with_defaults(tmp_path: Path) -> None:
    machine = load_machine(write(tmp_path, GOOD))
    assert (machine.predictor.Np, machine.predictor.p, machine.predictor.q) == (50, 20, 3)
    assert machine.fmi_parameters() == {
        "Np": 50,
        "p": 20,
        "q": 3,
        "lambda": 1e-12,
        "T_s": 0.002,
        "t_init": 0.3,
        "input_hold": 0,
        "dead_time": 0,
    }
    predictor = machine.new_predictor(p=10)
    assert (predictor.p, predictor.Ts) == (10, 0.002)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("zeta = 0.5", "zeta = 0.0", r"axis.toml: physics.mode\[1\].zeta: zeta must be > 0, got 0.0"),
        ("f_n = 30.0", "f_n = nan", r"physics.mode\[1\].f_n: f_n must be finite, got nan"),
        ("f_n = 30.0", 'f_n = "fast"', r"f_n must be a number, got 'fast'"),
        ("alpha = 35530.0", "", r"physics.mode\[1\].alpha is missing"),
        ("zeta = 0.5", "zeta = 0.5\ndamping = 1", r"physics.mode\[1\].damping is not an entry"),
        ("p = 20", "p = 60", r"predictor: p must be 1 … Np = 50, got 60; lower p or raise Np"),
        ("p = 20", "p = 2.5", r"predictor.p: p must be a whole number, got 2.5"),
        ("p = 20", "p = 20\nlambda = 0", r"predictor.lambda: lambda must be > 0 m2, got 0"),
        ("T_s = 0.002", "T_s = -1", r"T_s: T_s must be > 0 s, got -1"),
        ('kind = "stage"', 'kind = "robot"', r"plant: .*'feed_drive', 'stage'.*"),
        ('kind = "stage"\nf = 1e-5', 'kind = "feed_drive"', "feed_drive needs .physics.spring_mass_damper."),
        ('kind = "stage"', 'kind = "stage"\nkappa = -1', r"plant.kappa: kappa must be ≥ 0 1/m, got -1"),
        ('name = "axis"', 'name = "my axis"', "name: .*pattern"),
        ('sources = ["measured"]', "sources = []", "sources"),
        ("[predictor]", "[predictor]\n[predictor]", "not valid TOML"),
        ("[[physics.mode]]", "[physics.mode]", r"physics.mode must be a list of modes: write \[\[physics.mode\]\]"),
        ('kind = "stage"', "", "plant.kind is missing: feed_drive or stage"),
        ('title = "An axis"', 'title = "An \\u0001 axis"', "title must be one line of printable text"),
        ("T_s = 0.002", "T_s = true", "T_s must be a number, got True"),
        ("T_s = 0.002", 'T_s = "0.002"', "T_s must be a number, got '0.002'"),
        ("p = 20", "p = 20\nlam = 1e-12", "predictor.lam is not an entry"),
        ("[[physics.mode]]", "[[physics.modes]]", "physics.modes is not an entry"),
        ("[predictor]", "[physics.spring_mass_damper]\nm = 1\nc = 1\nk = 1\n[predictor]", "give either"),
        ("[predictor]", "[limits]\nvelocity = 0\nacceleration = 1\njerk = 1\n[predictor]", "limits.velocity"),
    ],
)
def test_bad_entries_are_refused_by_name(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(MachineError, match=message):
        load_machine(write(tmp_path, GOOD.replace(old, new)))


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(MachineError, match=r"no machine 'robot': expected a .toml file or one of als25010_x"):
        load_machine("robot")


def test_what_a_machine_does_not_have() -> None:
    emps = load_machine("emps")
    with pytest.raises(MachineError, match=r"machine emps has no \[plant\] section"):
        emps.new_plant()
    with pytest.raises(MachineError, match=r"machine emps has no \[limits\] section"):
        emps.trajectory_limits()
    assert load_machine("als25010_x").trajectory_limits().velocity == 0.08


def test_a_plant_and_a_dead_time_exclude_each_other(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match="dead_time = 0"):
        load_machine(write(tmp_path, GOOD.replace("[[physics.mode]]", "[physics]\ndead_time = 2\n[[physics.mode]]")))


def test_a_machine_can_be_made_in_code() -> None:
    machine = Machine(
        name="bench",
        title="bench",
        sources=("made up for this test",),
        physics=Physics(spring_mass_damper=SpringMassDamper(m=2.0, c=30.0, k=2e4)),
    )
    assert machine.model.modes[0].alpha == 1e4
