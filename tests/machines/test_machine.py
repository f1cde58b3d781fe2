"""Machine files: those that come with the library are consistent, bad ones are refused by name; their text."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compensator_cases import RECOMMENDED

from hybridsep import Encoder, Limits, load_machine, machine_names, simulate, spiral
from hybridsep.base.errors import MachineError
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, PredictorSettings
from hybridsep.machines.machine import Machine, machine_from_table, machine_path, machine_text
from hybridsep.machines.sections import LogSection, Physics, SpringMassDamper, StageSection

GOOD = """
name = "axis"
title = "An axis"
sources = ["measured"]
T_s = 0.001

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
        assert machine.model.dc_gain == pytest.approx(1.0, abs=1e-12 if name[:3] != "als" else 3e-4)
        assert machine.new_predictor().T_s == machine.T_s


@pytest.mark.parametrize(("axis", "gain"), [("x", 1.00005), ("y", 1.00029)])
def test_table_1_is_consistent(axis: str, gain: float) -> None:
    machine = load_machine(f"als25010_{axis}")
    assert machine.model.dc_gain == pytest.approx(gain, abs=5e-6)  # so ω_n is in Hz and the table is consistent
    assert isinstance(machine.plant, StageSection)
    assert machine.plant.kappa == pytest.approx(1.5e3 * machine.plant.f, rel=1e-12)  # 1.5e-3 mm⁻²


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "printed"), [("x", 22.0), ("y", 130.2)])
def test_the_stages_friction_is_calibrated(axis: str, printed: float) -> None:
    machine, x_d = load_machine(f"als25010_{axis}"), dict(zip("xy", spiral(), strict=True))[axis]
    x = Encoder(1e-6, 0).measure_all(simulate(machine.new_plant(), x_d, machine.T_s))
    discrete = machine.model.discretise(machine.T_s)
    x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
    assert 1e6 * np.sqrt(np.mean((x - x_pb) ** 2)) == pytest.approx(printed, rel=1e-4)


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
    settings = machine.predictor_settings
    assert (settings.Np, settings.p, settings.q) == (50, 20, 3)
    assert machine.fmi_parameters() == {**PredictorSettings(Np=50, p=20, T_s=0.001).to_fmi(), "dead_time": 0}
    predictor = machine.new_predictor(replace(machine.predictor_settings, p=10))
    assert (predictor.settings.p, predictor.T_s) == (10, 0.001)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("zeta = 0.5", "zeta = 0.0", r"axis.toml: physics.mode\[1\].zeta: zeta must be 1e-06 … 10000, got 0.0"),
        ("f_n = 30.0", 'f_n = "fast"', r"f_n must be a number, got 'fast'"),
        ("alpha = 35530.0", "", r"physics.mode\[1\].alpha is missing"),
        ("zeta = 0.5", "zeta = 0.5\ndamping = 1", r"physics.mode\[1\].damping is not an entry"),
        ("p = 20", "p = 60", r"predictor: p must be 1 … Np = 50, got 60; lower p or raise Np"),
        ("p = 20", "p = 20\nlambda = 0", r"predictor.lambda: lambda must be 1e-40 … 1e\+12 m2, got 0"),
        ("T_s = 0.001", "T_s = -1", r"T_s: T_s must be 1e-05 … 1 s, got -1"),
        ('kind = "stage"', 'kind = "robot"', r"plant.kind must not be 'robot', but feed_drive, stage, identified"),
        ('kind = "stage"\nf = 1e-5', 'kind = "feed_drive"', "feed_drive needs .physics.spring_mass_damper."),
        ('kind = "stage"', 'kind = "stage"\nkappa = -1', r"plant.kappa: kappa must be 0 … 1000000 1/m, got -1"),
        ('name = "axis"', 'name = "my axis"', "name must be a letter, then at most 99"),
        ('sources = ["measured"]', "sources = []", "sources"),
        ("[predictor]", "[predictor]\n[predictor]", "not valid TOML"),
        ("[[physics.mode]]", "[physics.mode]", r"physics.mode must be a list of modes: write \[\[physics.mode\]\]"),
        ('kind = "stage"', "", "plant.kind is missing: feed_drive, stage, identified"),
        ('title = "An axis"', 'title = "An \\u0001 axis"', "title must be one line of printable text"),
        ("p = 20", "p = 20\nlam = 1e-12", "predictor.lam is not an entry"),
        ("[[physics.mode]]", "[[physics.modes]]", "physics.modes is not an entry"),
        ("[predictor]", "[physics.spring_mass_damper]\nm = 1\nc = 1\nk = 1\n[predictor]", "mass_damper. or "),
        ("[predictor]", "[limits]\nvelocity = 0\nacceleration = 1\njerk = 1\n[predictor]", "limits.velocity"),
    ],
)
def test_bad_entries_are_refused_by_name(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(MachineError, match=message):
        load_machine(write(tmp_path, GOOD.replace(old, new)))


def test_the_compensators_settings_are_the_recommended_ones() -> None:
    for name, change_max in {"spring_mass_damper": 1e-3, "als25010_x": 1e-3, "als25010_y": 1.5e-3}.items():
        machine = load_machine(name)
        compensator = machine.new_compensator()
        assert compensator.predictor.settings == PredictorSettings(Np=50)
        paper = {"averaging": False, "q": 40, "lambda": 1e-8, "t_init": 0.1}  # as the comment there says
        assert machine.changed("compensator", paper).compensator_predictor == RECOMMENDED
        limits = Limits(0.1, 16.0, 5000.0)
        expected = CompensatorSettings(preview=200, spacing=2, limits=limits, change_max=change_max, horizon=200)
        assert compensator.settings == expected
        assert machine.new_predictor().Np == 100


PREVIEW = 200
COMPENSATED = GOOD + "\n[drive_limits]\nvelocity = 0.2\nacceleration = 8.0\njerk = 900.0\n\n[compensator]\n"


def test_what_the_compensator_section_leaves_out_is_the_predictors(tmp_path: Path) -> None:
    limits = Limits(0.2, 8.0, 900.0)
    expected = CompensatorSettings(limits=limits, change_max=1e-3, preview=PREVIEW, spacing=2, horizon=PREVIEW).to_fmi()
    expected |= {**PredictorSettings(Np=20, p=20, T_s=0.001).to_fmi(), "dead_time": 0}
    assert load_machine(write(tmp_path, COMPENSATED)).fmi_compensator_parameters() == expected
    entries = "Np = 30\nq = 9\nlambda = 1e-9\nt_init = 0.1\npreview = 180\nspacing = 3\njerk_weight = 0\n"
    entries += "no_reversal = false\n"
    machine = load_machine(write(tmp_path, COMPENSATED + entries))
    given = {"Np": 30, "p": 20, "q": 9, "lambda": 1e-9, "t_init": 0.1, "preview": 180, "spacing": 3, "jerk_weight": 0.0}
    given |= {"no_reversal": False}
    assert {name: machine.fmi_compensator_parameters()[name] for name in given} == given
    changes = replace(machine.compensator_settings, preview=90, horizon=90, change_max=None, compensate="physics")
    compensator = machine.new_compensator(changes, predictor=replace(machine.compensator_predictor, p=10))
    settings = PredictorSettings(Np=30, p=10, q=9, lam=1e-9, T_s=0.001, t_init=0.1)
    assert compensator.predictor.settings == settings
    assert compensator.settings == changes
    assert (changes.spacing, changes.no_reversal, changes.jerk_weight) == (3, False, 0.0)
    without = machine.new_compensator(predictor=replace(machine.compensator_predictor, averaging=False))
    assert without.predictor.regression.n_features == 2 + 9 + 20
    assert machine.fmi_parameters()["Np"] == 50


def test_a_late_measurement_of_the_predictor_is_the_compensators(tmp_path: Path) -> None:
    text = COMPENSATED.replace("p = 20", "p = 20\nmeasurement_delay = 3")
    machine = load_machine(write(tmp_path, text))
    assert machine.new_compensator().predictor.settings.measurement_delay == 3
    assert machine.fmi_compensator_parameters()["measurement_delay"] == 3
    own = load_machine(write(tmp_path, text + "measurement_delay = 0\n"))
    assert own.fmi_compensator_parameters()["measurement_delay"] == 0
    assert own.fmi_parameters()["measurement_delay"] == 3
    refused = "measurement_delay of a compensator must be 0 with averaging = false, got 3"
    with pytest.raises(MachineError, match=f"compensator: {refused}"):
        load_machine(write(tmp_path, text + "averaging = false\nmeasurement_delay = 3\n"))
    alone = machine.changed("predictor", {"averaging": False})  # of the predictor a late measurement is no matter
    assert alone.new_predictor().settings.measurement_delay == 3
    with pytest.raises(MachineError, match=rf"{refused}.* set averaging = true or measurement_delay = 0 in \["):
        alone.fmi_compensator_parameters()


@pytest.mark.parametrize(
    ("T_s", "entries", "expected"),
    [
        (1e-3, "", (PREVIEW, 2, 20, 20)),
        (5e-4, "", (PREVIEW, 2, 20, 20)),
        (1.5e-3, "", (133, 1, 14, 14)),
        (4e-3, "", (100, 1, 10, 10)),
        (1e-3, "preview = 300", (300, 3, 30, 20)),
        (1e-3, "preview = 60", (60, 2, 20, 20)),
        (1e-3, "preview = 8", (8, 1, 1, 1)),
        (1e-3, "Np = 50", (PREVIEW, 2, 50, 20)),
        (1e-3, "Np = 1900\nspacing = 20", (2000, 20, 1900, 20)),
    ],
)
def test_preview_spacing_and_window_follow_from_each_other(
    tmp_path: Path, T_s: float, entries: str, expected: tuple[int, ...]
) -> None:
    text = COMPENSATED.replace("T_s = 0.001", f"T_s = {T_s}") + entries + "\n"
    compensator = load_machine(write(tmp_path, text)).new_compensator()
    settings = compensator.predictor.settings
    assert (compensator.preview, compensator.spacing, settings.Np, settings.p) == expected


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ("preview = 7", r"axis.toml: compensator.preview: preview must be 8 … 2000, got 7"),
        ("lambda = 0", r"compensator.lambda: lambda must be 1e-40 … 1e\+12 m2, got 0"),
        ("change_max = 1e-3", r"compensator.change_max is not an entry"),
        ("no_reversal = 2", r"compensator.no_reversal: no_reversal must be true or false, got 2"),
        ("Np = 60\npreview = 66", r"compensator: preview must be ≥ Np \+ 4·spacing \+ 3 = 67, got 66$"),
        ("Np = 10\np = 20", r"compensator: p must be 1 … Np = 10, got 20; lower p or raise Np$"),
    ],
)
def test_bad_entries_of_the_compensator_are_refused_by_name(tmp_path: Path, entries: str, message: str) -> None:
    with pytest.raises(MachineError, match=message):
        load_machine(write(tmp_path, COMPENSATED + entries + "\n"))


def test_a_long_window_without_a_compensator_is_allowed(tmp_path: Path) -> None:
    long = GOOD.replace("Np = 50", "Np = 5000")
    assert load_machine(write(tmp_path, long)).predictor_settings.Np == 5000
    assert load_machine(write(tmp_path, f"{long}\n[compensator]\n")).compensator_predictor.Np == 20
    with pytest.raises(MachineError, match=r"compensator: preview must be ≥ Np \+ 4·spacing \+ 3 = 5011, got 2000$"):
        load_machine(write(tmp_path, f"{long}\n[compensator]\nNp = 5000\n"))


def test_without_drive_limits_there_is_a_compensator_but_no_fmu(tmp_path: Path) -> None:
    machine = load_machine(write(tmp_path, GOOD))
    compensator = machine.new_compensator()
    assert (compensator.settings.limits, compensator.settings.change_max) == (None, None)
    with pytest.raises(MachineError, match=r"machine axis has no \[drive_limits\], which a compensator must keep"):
        machine.fmi_compensator_parameters()


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match=r"no machine 'robot': expected a .toml file or one of als25010_x"):
        load_machine("robot")
    with pytest.raises(MachineError, match=r"no machine 'robot\.toml': there is no such file"):
        load_machine("robot.toml")
    write(tmp_path, GOOD).rename(tmp_path / "machine.toml")
    with pytest.raises(MachineError, match=r"expected a \.toml file or one of .*; .*machine\.toml is there"):
        load_machine(tmp_path)


def test_what_a_machine_does_not_have() -> None:
    emps = load_machine("emps")
    with pytest.raises(MachineError, match=r"machine emps has no \[plant\], which"):
        emps.new_plant()
    with pytest.raises(MachineError, match=r"machine emps has no \[limits\]"):
        emps.trajectory_limits()
    assert load_machine("als25010_x").trajectory_limits().velocity == 0.08


def test_a_stage_and_a_dead_time_exclude_each_other(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match=r"plant of kind feed_drive or stage must have .*physics\.dead_time = 0"):
        load_machine(write(tmp_path, GOOD.replace("[[physics.mode]]", "[physics]\ndead_time = 2\n[[physics.mode]]")))


def test_a_machine_can_be_made_in_code() -> None:
    physics = Physics(spring_mass_damper=SpringMassDamper(m=2.0, c=30.0, k=2e4))
    machine = Machine(name="bench", title="bench", sources=("made up for this test",), physics=physics)
    assert machine.model.modes[0].alpha == 1e4


# As text ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", machine_names())
def test_a_written_machine_is_read_again(name: str, tmp_path: Path) -> None:
    machine = load_machine(name)
    path = write(tmp_path, machine_text(machine, ["identified", "two lines\nof text"]))
    assert load_machine(path) == machine
    assert path.read_text(encoding="utf-8").startswith("# identified\n# two lines\n# of text\nname = ")


def test_text_with_quotes_and_no_sources(tmp_path: Path) -> None:
    physics = {"spring_mass_damper": {"m": 2.0, "c": 30.0, "k": 2e4}}
    machine = machine_from_table({"name": "a", "title": 'the "old" axis \\ Y', "physics": physics})
    path = write(tmp_path, machine_text(machine))
    assert load_machine(path) == machine
    assert load_machine(path).sources == ()


def test_units_stand_beside_the_entries() -> None:
    text = machine_text(load_machine("als25010_x"))
    assert f"f_n = 20.52{'':<19}# {PARAMETERS['f_n'].unit}".replace(" ", "") in text.replace(" ", "")
    assert "Np = 100\n" in text


def test_units_of_a_rotary_axis_are_angles() -> None:
    limits = {"velocity": 3.0, "acceleration": 30.0, "jerk": 2e3, "change_max": 0.1}
    physics = {"spring_mass_damper": {"m": 2.0, "c": 30.0, "k": 2e4}}
    table = {"name": "a", "unit": "rad", "title": "Table", "physics": physics, "drive_limits": limits}
    machine = machine_from_table(table)
    text = "".join(machine_text(machine).split())
    assert "velocity=3.0#rad/sacceleration=30.0#rad/s2jerk=2000.0#rad/s3change_max=0.1#rad" in text


TEXT = machine_path("spring_mass_damper").read_text(encoding="utf-8")


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(TEXT, encoding="utf-8-sig")
    assert load_machine(tmp_path / "machine.toml") == load_machine("spring_mass_damper")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\n".join(f"k{i} = 1" for i in range(2000)), r"k8 is not an entry .* … and 1991 more"),
        ('"a\\nb" = 1', r"'a\\nb' is not an entry"),
        (f"name = '{'x' * 100_000}-'", r"name must be .* got 'x{59}… \(100003 characters\)"),
        ("a = [" + "[" * 100_000, "is not valid TOML: "),
        (f"T_s = {'9' * 5000}", r"is not valid TOML: Exceeds the limit \(4300"),
        (f"T_s = 0x{'f' * 5000}", "T_s must be a number, got a value of type int that is too long"),
        (f"T_s{'.a' * 5000} = 1", "T_s must be a number, got a value of type dict"),
        ('title = "An \\uFFFE axis"', "title must be one line of printable text that XML 1.0 allows"),
        ('sources = ["a \\uFFFF test"]', r"sources must be a list, each entry one line of printable text"),
    ],
)
def test_messages_are_one_line_of_a_reasonable_length(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(MachineError, match=message) as caught:
        load_machine(path)
    assert len(str(caught.value)) < 1000
    assert "\n" not in str(caught.value)


OPTIONS = "x_d x | x T_s | x_d x; x_d x | error | x_d error; x_d x | x error | x error; x_d error | x | x_d x; "
OPTIONS += "x error | x_d | x x_d; x error | error | x error; t x_d error | x_d | t x_d error; t x | x T_s | x"


@pytest.mark.parametrize("one", OPTIONS.split("; "))
def test_an_error_and_the_position_that_it_stands_for_are_not_both_named(one: str) -> None:
    own, given, named = map(str.split, one.split(" | "))
    options = dict.fromkeys({*given} - {"T_s"}, "given")
    found = LogSection(table=dict.fromkeys(own, "own")).columns_beside(options, 1e-3 if "T_s" in given else None)
    assert found == {role: options.get(role, "own") for role in named}
