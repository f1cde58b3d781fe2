"""Plants: against a tight solve_ivp run, against the linear model, and the noise against its definition."""

import math
from itertools import product

import numpy as np
import pytest
from c_core import CModel
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from stream import STAGE

from hybridsep import Encoder, ModalModel, Mode, Plant, load_machine, simulate
from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PARAMETERS
from hybridsep.base.signals import Array
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.stage_drive import StageDrive, velocity_under_friction
from hybridsep.plants.trajectory import spiral, staircase

TS = 1e-3
V_FRICTION = PARAMETERS["v_friction"].default


def tight(slope: object, z: Array, commands: Array, position: object) -> Array:
    """Integrate sample by sample with DOP853 at 1e-13 and return the positions at the samples."""
    x = np.empty(len(commands))
    for k, r in enumerate(commands):
        x[k] = position(z)  # type: ignore[operator]
        z = solve_ivp(slope, (0, TS), z, "DOP853", args=(k, r), rtol=1e-13, atol=1e-16).y[:, -1]
    return x


def test_the_drive_is_integrated_to_less_than_a_nanometre() -> None:
    m, c, k, c_nl, k_nl = 1.0, 15.7, 24674.0, 100.0, 1000.0
    x_d = staircase()[2000:3400] + 0.02  # the largest deflection and a way back

    def slope(t: float, z: Array, i: int, r: float) -> list[float]:
        x, u = z
        v = u + c / m * (r - x_d[0])
        return [v, -c / m * v - k / m * (x - (r - x_d[0])) - (c_nl * v * abs(v) + k_nl * x * abs(x)) / m]

    truth = x_d[0] + tight(slope, np.zeros(2), x_d, lambda z: z[0])
    x = simulate(FeedDrive(m, c, k, c_nl, k_nl), x_d, TS)
    assert np.max(np.abs(x - truth)) < 1e-9


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_stage_is_integrated_to_less_than_a_nanometre(axis: str) -> None:
    machine = load_machine(f"als25010_{axis}")
    stage = machine.new_plant()
    assert isinstance(stage, StageDrive)
    x_d = dict(zip("xy", spiral(), strict=True))[axis][:700]
    v_d = np.diff(x_d, prepend=x_d[0]) / TS
    modes = machine.model.modes

    def position(z: Array) -> float:
        return float(sum(mode.alpha * z[2 * i] + mode.beta * z[2 * i + 1] for i, mode in enumerate(modes)))

    def slope(t: float, z: Array, k: int, r: float) -> list[float]:
        x = position(z)
        # x = G_pb (x_d − d), d = f tanh(v_d / 2 mm/s) + κ x |x|
        u = r - stage.f * math.tanh(v_d[k] / 2e-3) - stage.kappa * x * abs(x)
        out: list[float] = []
        for i, mode in enumerate(modes):
            out += [z[2 * i + 1], u - 2 * mode.zeta * mode.omega * z[2 * i + 1] - mode.omega**2 * z[2 * i]]
        return out

    truth = tight(slope, np.zeros(2 * len(modes)), x_d, position)
    assert np.max(np.abs(simulate(stage, x_d, TS) - truth)) < 1e-9


@pytest.mark.parametrize("gain", [-0.06, -2e-3, -1e-3, 0.0, 1e-3, 0.5, 1e9])
def test_the_velocity_solves_its_equation(gain: float) -> None:
    for w, last in product([-10.0, -0.05, -1e-3, -1e-9, 1e-12, 1e-3, 0.02, 0.07, 3.0], [-0.1, 0.0, 0.1]):
        v = velocity_under_friction(w, gain, V_FRICTION, last)
        assert v + gain * math.tanh(v / V_FRICTION) == pytest.approx(w, rel=1e-9, abs=1e-15 * abs(gain))
        assert v == -velocity_under_friction(-w, gain, V_FRICTION, -last)
        # stable: more velocity would meet more resistance
        assert 1.0 + gain / V_FRICTION * (1.0 - math.tanh(v / V_FRICTION) ** 2) > -1e-3


def test_the_direction_is_kept_until_its_solution_ends() -> None:
    gain, v, found = -0.06, 0.1, []
    for w in np.linspace(0.1, -0.1, 2001):
        v = velocity_under_friction(w, gain, V_FRICTION, v)
        found.append(v)
    turned = int(np.argmax(np.array(found) < 0.0))
    turn = V_FRICTION * math.acosh(math.sqrt(-gain / V_FRICTION))
    assert 0.1 - 1e-4 * turned == pytest.approx(turn + gain * math.tanh(turn / V_FRICTION), abs=2e-4)


def test_the_motion_is_integrated_to_a_nanometre() -> None:
    modes = [Mode(25.0, 0.3, (2 * math.pi * 25.0) ** 2, 20.0)]
    f, beta = 1e-5, sum(mode.beta for mode in modes)
    x_d = staircase()[:250]

    def slope(t: float, z: Array, k: int, r: float) -> list[float]:
        mode = modes[0]
        free = r - 2 * mode.zeta * mode.omega * z[1] - mode.omega**2 * z[0]
        w, gain = mode.alpha * z[1] + beta * free, beta * f
        v = brentq(lambda v: v + gain * math.tanh(v / V_FRICTION) - w, w - gain, w + gain, xtol=1e-18)
        return [z[1], free - f * math.tanh(v / V_FRICTION)]

    truth = tight(slope, np.zeros(2), x_d, lambda z: modes[0].alpha * z[0] + beta * z[1])
    x = simulate(StageDrive(ModalModel(modes), f, T_s=TS, friction_on="motion"), x_d, TS)
    assert np.max(np.abs(x - simulate(StageDrive(ModalModel(modes), f, T_s=TS), x_d, TS))) > 1e-6
    assert np.max(np.abs(x - truth)) < 1e-9


def test_without_nonlinearity_the_plants_are_their_models() -> None:
    modal = ModalModel([Mode(40.0, 0.3, 9e4, 5.0), Mode(90.0, 0.05, -2e4, 1.0)])
    fast = [ModalModel([Mode(f_n, 0.05, (2 * math.pi * f_n) ** 2)]) for f_n in (500.0, 5000.0)]
    cases: list[tuple[ModalModel, Plant, int, float]] = [
        (ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), FeedDrive(1.0, 15.7, 24674.0), 1500, 1e-10),
        (modal, StageDrive(modal), 1500, 1e-10),
        *((one, StageDrive(one), 100, 1e-9) for one in fast),  # fast modes are resolved, too
    ]
    for model, plant, n, atol in cases:
        discrete, x_d = model.discretise(TS), staircase()[:n]
        x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
        np.testing.assert_allclose(simulate(plant, x_d, TS), x_pb, rtol=0, atol=atol)


@pytest.mark.parametrize(
    ("hold", "dead_time", "friction_on"),
    [("zoh", 1, "command"), ("zoh", 3, "motion"), ("foh", 0, "command"), ("foh", 1, "motion"), ("foh", 3, "command")],
)
def test_a_stage_delays_and_holds_the_command_as_its_model(hold: str, dead_time: int, friction_on: str) -> None:
    x_d = staircase()[:600] + 0.1
    model = ModalModel(load_machine("als25010_x").model.modes, dead_time)
    discrete = model.discretise(TS, hold)
    x_pb = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0] + x_d[0]
    plant = StageDrive(model, T_s=TS, input_hold=hold)
    x = simulate(plant, x_d, TS)
    # Without a dead time a first-order hold would need the next command: it goes on as it came.
    held = np.max(np.abs(simulate(StageDrive(model, T_s=TS), x_d, TS) - x_pb))
    assert np.max(np.abs(x - x_pb)) < (0.25 * held if (hold, dead_time) == ("foh", 0) else 1e-9)
    assert np.max(np.abs(x - x_d)) > 1e-5
    values = {"f": 8e-6, "kappa": 0.0213165, "v_friction": 5e-3, "noise_std": 0.0, "dead_time": dead_time}
    chosen = {"input_hold": ["zoh", "foh"].index(hold), "friction_on": ["command", "motion"].index(friction_on)}
    core = CModel(STAGE, {**values, **chosen})
    core["x_d"] = x_d[0]
    core.start_values()
    core.initialise(0.0)

    def rubbed() -> StageDrive:
        return StageDrive(model, 8e-6, values["kappa"], TS, friction_on, v_friction=5e-3, input_hold=hold)

    plant = rubbed()
    plant.reset(float(x_d[0]))
    for k, command in enumerate(x_d[:300].tolist()):
        if k == 150:
            other = rubbed()
            other.restore(plant.state())
            plant = other
        core["x_d"] = command
        for i in range(2):  # the command is sampled at the instants, whatever the step
            core.step((k + i / 2) * TS, TS / 2)
            plant.step(command, TS / 2)
            assert core["x"] == pytest.approx(plant.x, abs=1e-12)


def test_velocity_is_the_derivative_of_the_position() -> None:
    for plant in (load_machine("spring_mass_damper").new_plant(), load_machine("als25010_x").new_plant()):
        plant.reset(0.0)
        for k in range(50):
            plant.step(1e-6 * k**2, TS)
        plant.step(1e-6 * 50**2, TS / 2)
        before, v = plant.x, plant.v
        plant.step(1e-6 * 50**2, 1e-6)
        assert (plant.x - before) / 1e-6 == pytest.approx(v, rel=1e-3)


def test_encoder_draws_split_mix_64_and_box_muller() -> None:
    # The first numbers of SplitMix64 from seed 0, as published with the generator
    first, second = 0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4
    u1, u2 = ((first >> 11) + 1) * 2.0**-53, (second >> 11) * 2.0**-53
    expected = 5e-6 * math.sqrt(-2 * math.log(u1)) * math.cos(2 * math.pi * u2)
    assert Encoder(5e-6, 0).measure(1.0) - 1.0 == pytest.approx(expected, abs=1e-15)


def test_encoder_noise_is_normal_and_seeded() -> None:
    noise = Encoder(1.0, 7).measure_all(np.zeros(20_000))
    assert abs(np.mean(noise)) < 4 / math.sqrt(20_000)
    assert np.std(noise) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(noise) > 1.959964) == pytest.approx(0.05, abs=0.006)
    assert abs(np.corrcoef(noise[:-1], noise[1:])[0, 1]) < 0.03
    assert not np.array_equal(noise, Encoder(1.0, 8).measure_all(np.zeros(20_000)))
    assert np.array_equal(noise, Encoder(1.0, 7).measure_all(np.zeros(20_000)))


def test_no_samples_are_refused() -> None:
    with pytest.raises(SignalError, match="x_d must have at least one sample, got none"):
        simulate(FeedDrive(1.0, 1.0, 1.0), [], TS)


@pytest.mark.parametrize(("name", "changes"), [("spring_mass_damper", {"c_nl": 1e4}), ("als25010_x", {"kappa": 1e2})])
def test_a_step_that_overflows_changes_nothing(name: str, changes: dict[str, float]) -> None:
    plant = load_machine(name).new_plant(**changes)
    plant.step(1e-3, TS)
    before = plant.state()
    with pytest.raises(SignalError, match="state overflowed"):
        plant.step(1e3, 0.5)
    assert plant.state() == before
