"""The HAL component over a stub of HAL (hal_stub.c): what goes to the drive never steps, whatever comes in."""

import ctypes
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from built_once import built_once, shared_builds
from c_compiler import compiler
from hypothesis import given
from hypothesis import strategies as st
from machine_files import changed_machine
from places import ROOT
from programs import output_of
from properties import examples

from hybridsep import load_machine
from hybridsep.base.signals import Array
from hybridsep.fmi.controllers import COMPONENTS, axis_files, component_files
from hybridsep.machines.machine import Machine

X = ROOT / "integrations" / "linuxcnc" / "simulation" / "x.toml"  # 250 mm/s, 2500 mm/s², 10 000 m/s³; 1 kHz
PREVIEW = ("compensator.preview=60",)  # look-ahead in the tests, periods: shorter than the machine's, so that they are
V, A = 0.25, 2.5e-3  # its limits, mm a period and mm a period²
FOLLOWS = 0.15  # share of its distance to the command that the simulated drive goes in a period

OUT, DELAYED, FB_JOINT, PREDICTED, ERROR, STD, STATE = range(7)
"""Columns of what a component writes; positions in machine units."""

_HEADERS = ("hal.h", "rtapi.h", "rtapi_app.h", "rtapi_math.h")


@cache
def _library(model: str) -> ctypes.CDLL:
    def build(folder: Path) -> None:
        for name, content in component_files(model).items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.replace(b"#pragma GCC optimize", b"// "))
        for name in _HEADERS:
            (folder / name).write_text("")
        source = Path(__file__).with_name("hal_stub.c")
        command = [*compiler(), "-std=gnu11", "-D_GNU_SOURCE", "-O0", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"]
        command += ["-Wno-unused-function", "-Wno-ignored-qualifiers", f"-I{folder}"]
        command += [f'-DCOMPONENT="{COMPONENTS[model]}.c"']
        output_of(*command, source, "-o", folder / "component.so", "-lm")

    folder = built_once(shared_builds() / f"hal_{model}", build)
    loaded = ctypes.CDLL(str(folder / "component.so"))
    loaded.stub_scale.restype = ctypes.c_double
    loaded.stub_message.restype = ctypes.c_char_p
    loaded.stub_parameters.argtypes = [ctypes.c_double, ctypes.c_int]
    loaded.stub_step.argtypes = [ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
    return loaded


class Component:
    """One axis, loaded; a process has one of a model at a time.

    ``folder``: for the axis' own folder; ``model``: {"SepCompensator", "HybridPredictor"}.
    """

    def __init__(self, machine: Machine, folder: Path, model: str = "SepCompensator") -> None:
        self._loaded, self.machine = _library(model), machine
        axis = folder / machine.name
        axis.mkdir(parents=True, exist_ok=True)
        for name, content in axis_files(machine, model).items():
            (axis / name).write_bytes(content)
        self._axis = ctypes.create_string_buffer(bytes(axis))  # the component keeps the pointer
        assert self._loaded.stub_load(self._axis) == 0, self.message
        self.scale, self.look_ahead = float(self._loaded.stub_scale()), int(self._loaded.stub_look_ahead())
        self._inputs, self._outputs = np.zeros(5), np.zeros(7, dtype=np.float64)

    def set(self, *, scale: float | None = None, model: int = 2) -> None:
        """Set the parameters."""
        self._loaded.stub_parameters(self.scale if scale is None else scale, model)

    def step(
        self,
        cmd: float,
        fb: float,
        *,
        active: bool = True,
        enable: bool = True,
        reset: bool = False,
        period: float = 1.0,
    ) -> Array:
        """Do a period, relative to the machine's interval; return what the pins show, ``(7,)``."""
        self._inputs[:] = cmd, fb, active, enable, reset
        ns = round(1e9 * period * self.machine.T_s)
        self._loaded.stub_step(ns, self._inputs.ctypes.data, self._outputs.ctypes.data)
        return np.array(self._outputs)

    def break_model(self) -> None:
        """Let the model refuse the next sample."""
        self._loaded.stub_break()

    @property
    def messages(self) -> int:
        """Number of messages since it was loaded."""
        return int(self._loaded.stub_messages())

    @property
    def message(self) -> str:
        """The last one."""
        return str(self._loaded.stub_message().decode())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("axes")


def changed(folder: Path, name: str, *changes: tuple[str, str]) -> Machine:
    """Return a machine with parts of its file's text replaced."""
    always = ('name = "x"', f'name = "{name}"'), ("preview = 100", "preview = 60")
    return load_machine(changed_machine(folder / f"{name}.toml", X, *always, *changes))


class Run:
    """A drive of first order after the component, and what the component writes.

    ``cmd``: list, mm: the command as it came; ``fb``: mm: where the drive is; ``shown``: each (7,).
    """

    def __init__(self, component: Component, start: float = 0.0) -> None:
        self.component, self.fb, self.origin = component, start, 0.0
        self.cmd: list[float] = [start]
        self.shown: list[Array] = []
        self.pins = {"active": True, "enable": True}
        self.late = 0.0

    def step(self, cmd: float, fb: float | None = None, **pins: float) -> Array:
        """Do a period; ``fb`` instead of what is measured, mm."""
        measured = self.fb + self.origin if fb is None else fb
        shown = self.component.step(cmd, measured, **{**self.pins, **pins})  # type: ignore[arg-type]
        self.cmd.append(cmd)
        self.shown.append(shown)
        self.fb += FOLLOWS * (shown[OUT] - self.origin - self.fb)
        return shown

    def move(self, to: float, speed: float, acceleration: float = 2e-3, **pins: float) -> None:
        """Move, mm, mm a period and mm a period²."""
        position, velocity = self.cmd[-1], 0.0
        while position != to:
            left = to - position
            allowed = math.copysign(min(speed, math.sqrt(2 * acceleration * abs(left))), left)
            velocity += max(-acceleration, min(acceleration, allowed - velocity))
            near = abs(left) <= acceleration or abs(left) <= abs(velocity) <= 2 * acceleration
            position = to if near else position + velocity
            self.step(position, **pins)

    def stay(self, periods: int, **pins: float) -> None:
        for _ in range(periods):
            self.step(self.cmd[-1], **pins)

    def column(self, column: int) -> Array:
        return np.array(self.shown)[:, column]


def assert_no_step(run: Run) -> None:
    """Differences of ``out`` are ``delayed``'s, plus what the limits allow."""
    for order, limit in ((1, V), (2, A)):
        allowed = np.abs(np.diff(run.column(DELAYED), order)) + limit * (1 + 1e-6)
        assert np.all(np.abs(np.diff(run.column(OUT), order)) <= allowed), order


@pytest.mark.parametrize(("faster", "enable"), [(0.95, True), (2.2, True), (4.0, False)])
def test_a_rapid_is_followed_late(folder: Path, faster: float, enable: bool) -> None:
    run = Run(Component(load_machine(X, PREVIEW), folder))
    run.pins["enable"] = enable
    run.stay(100)
    for to in (120.0, 0.0):
        run.move(to, faster * V)
        run.stay(150)
    out, delayed = run.column(OUT), run.column(DELAYED)
    np.testing.assert_allclose(delayed[60:], run.cmd[1:-60], atol=1e-9)
    assert_no_step(run)
    fast = np.append(False, np.abs(np.diff(delayed)) > V * (1 + 1e-6))
    assert np.max(np.abs(out - delayed)[fast], initial=0.0) < 1e-9
    assert (np.max(np.abs(out - delayed)) > 0.1) == enable
    assert run.component.messages == 0


def test_states_and_what_they_end_with(folder: Path) -> None:
    run = Run(Component(changed(folder, "late", ("[compensator]", "[compensator]\nmeasurement_timeout = 0.1")), folder))

    def states(periods: int, fb: float | None = None, **pins: float) -> list[int]:
        first = len(run.shown)
        for _ in range(periods):
            run.step(20.0 * math.sin(8e-3 * (len(run.shown) + 1)), fb, **pins)
        return [int(shown[STATE]) for shown in run.shown[first:]]

    assert states(400)[-1] >= 2
    missing = states(300, math.nan)
    assert min(missing[:99]) >= 2
    assert missing[100:] == [-3] * 200
    change = run.column(OUT) - run.column(DELAYED)
    assert np.max(np.abs(change[300:400])) > 0.1
    assert np.max(np.abs(change[-100:])) < 1e-9
    assert states(100)[-1] >= 2
    assert states(100, math.inf)[0] >= 2
    assert states(60)[-1] >= 2
    assert states(100, enable=False)[-1] == 1
    assert states(100, period=1.5)[-1] == -2
    assert states(300)[-1] == 1  # in motion, until it rests
    position = run.cmd[-1]
    for _ in range(100):
        run.step(position)
    assert run.shown[-1][STATE] >= 2
    assert states(1, active=False) == [0]
    assert run.component.messages == 0


def test_a_trip_fades_in_motion_and_ends_with_reset(folder: Path) -> None:
    monitored = changed(folder, "monitored", ("change_max", "following_error_max = 0.01\nchange_max"))
    run = Run(Component(monitored, folder))
    run.stay(100)
    for k in range(700):
        fb = run.fb + 30.0 if k in (300, 301, 302) else None
        run.step(20.0 * math.sin(8e-3 * k), math.nan if 400 <= k < 500 else fb, reset=k == 550)
    state, change = run.column(STATE)[100:], np.abs(run.column(OUT) - run.column(DELAYED))[100:]
    assert set(state[100:303]) <= {2, 3}
    assert set(state[304:550]) == {4}
    assert state[552] == 1
    assert set(state[620:]) <= {2, 3}
    assert np.max(change[200:300]) > 0.1
    assert np.max(change[400:551]) < 1e-9
    assert np.max(change[620:]) > 0.1
    assert_no_step(run)


@pytest.mark.parametrize(("cmd", "said"), [(math.nan, "finite, got nan"), (2e6, "within ±1000 m, got 2000")])
def test_a_command_that_is_none_is_held(folder: Path, cmd: float, said: str) -> None:
    run = Run(Component(load_machine(X, PREVIEW), folder))
    run.stay(100)
    run.move(30.0, V)
    for _ in range(100):
        assert run.step(cmd)[STATE] == -1
    assert (run.component.messages, f"cmd must be {said}; the last one is held" in run.component.message) == (1, True)
    assert run.shown[-1][[OUT, DELAYED]] == pytest.approx(30.0, abs=1e-3)
    run.cmd[-1] = 30.0
    run.stay(100)
    assert run.shown[-1][STATE] >= 2
    run.step(cmd)
    assert run.component.messages == 1


def test_a_fault_is_said_once_and_ends_with_reset(folder: Path) -> None:
    run = Run(Component(load_machine(X, PREVIEW), folder))
    run.stay(100)
    run.move(30.0, V)
    run.component.break_model()
    run.move(60.0, V)
    run.stay(200)
    assert run.shown[-1][STATE] == -1
    assert run.component.messages == 1
    assert "hsep.x: the communication point must be" in run.component.message
    change = run.column(OUT) - run.column(DELAYED)
    assert np.max(np.abs(change)) > 0.1
    assert change[-1] == 0.0
    assert_no_step(run)
    assert run.step(60.0, reset=True)[STATE] == 2


def test_reset_in_motion_waits_for_rest(folder: Path) -> None:
    run = Run(Component(load_machine(X, PREVIEW), folder))
    run.stay(100)
    run.move(10.0, V)
    run.step(10.0, reset=True)
    run.move(60.0, V)
    assert {1} <= set(run.column(STATE)[-60:])
    run.stay(150)
    assert run.shown[-1][STATE] >= 2
    assert_no_step(run)


@pytest.mark.parametrize(("model", "before"), [("SepCompensator", 0), ("SepCompensator", 1), ("HybridPredictor", 1)])
def test_another_origin_moves_out_at_once(folder: Path, model: str, before: int) -> None:
    """Homing to an index, at a constant velocity: LinuxCNC answers to the feedback, in the same period or the next."""
    run = Run(Component(load_machine(X, PREVIEW), folder, model))
    run.stay(100)
    for k in range(400):
        jumped = -17.0 if k >= 300 else 0.0
        run.origin = -17.0 if k >= 300 - before else 0.0
        shown = run.step(0.02 * k + jumped)
        if k >= 200:
            assert shown[DELAYED] == pytest.approx(0.02 * (k - run.component.look_ahead) + jumped, abs=0.021)
            assert shown[STATE] in (2, 3)
    out, delayed = run.column(OUT), run.column(DELAYED)
    assert np.flatnonzero(np.abs(np.diff(out)) > 0.1).tolist() == [399]
    for column, most in ((out, A), (delayed, 1e-9)):  # without the jump
        whole = np.concatenate((column[200:400], column[400:] + 17.0))
        assert np.max(np.abs(np.diff(whole, 2))) <= most * (1 + 1e-6)


def test_a_jump_of_one_of_them_is_no_origin(folder: Path) -> None:
    run = Run(Component(load_machine(X, PREVIEW), folder))
    run.stay(150)
    run.origin = 5.0
    shown = [run.step(0.0) for _ in range(100)]
    assert max(abs(one[OUT]) for one in shown) < 1.0
    run.origin = 0.0
    run.stay(200)
    run.step(5.0)
    run.stay(59)
    assert abs(run.shown[-1][OUT]) < 1e-6
    run.stay(1)
    assert run.shown[-1][OUT] == pytest.approx(5.0)


def test_a_rotary_axis_turns_on(folder: Path) -> None:
    unit = ('unit = "m"', 'unit = "rad"') if 'unit = "m"' in X.read_text() else ("T_s =", 'unit = "rad"\nT_s =')
    limits = ("velocity = 0.25 ", "velocity = 40.0 "), ("acceleration = 2.5 ", "acceleration = 4000.0 ")
    component = Component(changed(folder, "c", unit, *limits, ("jerk = 10000.0", "jerk = 1e7")), folder)
    assert component.scale == pytest.approx(180.0 / math.pi)
    turns = 360.0 * 300
    run = Run(component, turns)
    run.stay(100)
    assert run.shown[-1][STATE] == 2
    assert run.shown[-1][[OUT, DELAYED, FB_JOINT]] == pytest.approx(turns)
    run.move(turns + 360.0 * 60, 30.0 * component.scale * 1e-3, 0.1)
    assert set(run.column(STATE)[-500:]) <= {2, 3}
    assert component.messages == 0
    for _ in range(5):
        run.step(1e9)
    assert "must be within ±1e+06 rad, got" in component.message


def test_nothing_but_numbers_is_written(folder: Path) -> None:
    component = Component(load_machine(X, PREVIEW), folder)
    for cmd, fb, active in ((math.nan, math.nan, False), (math.nan, math.nan, True), (math.inf, 3.0, False)):
        assert np.isfinite(component.step(cmd, fb, active=active)).all()
    assert component.step(math.nan, 3.0, active=False)[OUT] == pytest.approx(3.0)
    assert component.step(4.0, 3.0, active=False)[OUT] == pytest.approx(3.0)
    lost = component.step(4.0, math.nan, active=False)
    assert (lost[OUT], lost[STATE]) == (pytest.approx(4.0), -3)  # nothing that is old
    shown = np.array([component.step(4.0, math.nan) for _ in range(2000)])
    assert np.isfinite(shown).all()
    assert np.max(np.abs(np.diff(shown[:, OUT], prepend=4.0))) <= V
    assert shown[-1, OUT] == pytest.approx(4.0)
    late = Component(load_machine(X, PREVIEW), folder)
    shown = np.array([late.step(4.0 if k else math.nan, 3.0) for k in range(500)])
    assert shown[0, OUT] == pytest.approx(3.0)
    assert np.max(np.abs(np.diff(shown[:, OUT]))) <= V
    component = Component(load_machine(X, PREVIEW), folder)
    component.step(4.0, 4.0)
    component.set(scale=0.0)
    assert component.step(4.0, 4.0)[OUT] == pytest.approx(4.0)
    assert component.step(4.0, 4.0, active=False)[OUT] == pytest.approx(4.0)


def test_names_are_as_long_as_hal_allows(folder: Path) -> None:
    """Names of pins, parameters and functions."""
    for model, letters in (("SepCompensator", 31), ("HybridPredictor", 21)):
        Component(changed(folder, "n" * letters), folder, model)
        assert _library(model).stub_longest_name() == 47


EVENTS = st.tuples(
    st.sampled_from(
        [
            *("move", "move", "move", "lurch", "stay", "jump", "glitch", "origin", "cmd NaN", "fb NaN", "fb inf"),
            *("enable", "reset", "off", "period", "model", "scale", "far", "break"),
        ]
    ),
    st.integers(1, 150),
    st.floats(-1.0, 1.0),
)
"""What happens, for how many periods, how much of it."""


@pytest.mark.slow
@examples(150)
@given(st.lists(EVENTS, min_size=4, max_size=25), st.integers(0, 2**16))
def test_nothing_steps(
    tmp_path_factory: pytest.TempPathFactory, events: list[tuple[str, int, float]], seed: int
) -> None:
    """Between two periods out moves as the command of look-ahead periods ago did, plus what the limits allow."""
    base = tmp_path_factory.getbasetemp()
    monitored = changed(base, "monitored", ("change_max", "following_error_max = 0.01\nchange_max"))
    component = Component(monitored, base)
    run, rng = Run(component), np.random.default_rng(seed)
    held, velocity, enable, origins = [0.0], 0.0, True, [0.0]  # before the first step
    n_active: list[bool] = []

    def step(position: float, fb: float | None = None, **pins: float) -> None:
        measured = run.fb + run.origin + 2e-4 * rng.standard_normal() if fb is None else fb
        run.step(position, measured, enable=enable, **pins)
        held.append(position if abs(position) < 1e6 else held[-1])
        origins.append(run.origin)
        n_active.append(bool(pins.get("active", True)))

    step(0.0)
    for what, periods, amount in events:
        if what == "origin":  # after a rest, so that nothing else explains it
            for _ in range(250):
                step(held[-1])
            run.origin += math.copysign(5.0 + 20.0 * abs(amount), amount)
            step(held[-1] + run.origin - origins[-1])
            velocity = 0.0
        elif what == "jump":
            step(held[-1] + 20.0 * amount)
        elif what == "glitch":
            step(held[-1], run.fb + run.origin + 20.0 * amount)
        elif what == "break":
            component.break_model()
        elif what == "far":
            step(math.copysign(2e6, amount))
        elif what == "enable":
            enable = not enable
        elif what == "reset":
            step(held[-1] + velocity, reset=True)
        elif what in ("model", "scale"):
            component.set(model=1 if amount < 0 else 2, scale=component.scale * (2.0 if what == "scale" else 1.0))
        elif what == "lurch":
            velocity = 10.0 * V * amount
        elif what == "stay":
            velocity = 0.0
            for _ in range(periods):
                step(held[-1])
        wanted = {"move": 1.2 * V * amount if periods % 3 else 10.0 * V * amount}.get(what, velocity)
        pins = {"active": False} if what == "off" else {"period": 1.0 + 0.5 * amount} if what == "period" else {}
        fb = {"fb NaN": math.nan, "fb inf": math.inf}.get(what)
        for _ in range(periods):
            velocity += max(-2e-3, min(2e-3, wanted - velocity))
            step(math.nan if what == "cmd NaN" else held[-1] + velocity, fb, **pins)
        component.set()  # an inactive axis would take another scale
    shown = np.array(run.shown)
    assert np.isfinite(shown).all()
    out, active = shown[:, OUT], np.array(n_active)
    # Relative to the origin: the command of look-ahead periods ago
    origin, past = np.array(origins[1:]), np.array(held[1:]) - np.array(origins[1:])
    delayed = np.concatenate((np.zeros(component.look_ahead), past))[: len(past)]
    np.testing.assert_allclose(shown[:, DELAYED] - origin, delayed, rtol=0, atol=4 * A)
    np.testing.assert_allclose(np.where(active, 0.0, out - shown[:, FB_JOINT]), 0.0, atol=1e-9)
    here = out - origin
    ongoing = active[1:]
    allowed = np.abs(np.diff(delayed)) + V * (1 + 1e-6)
    assert np.all((np.abs(np.diff(here)) <= allowed)[ongoing])
    both = active[2:] & active[1:-1] & active[:-2]
    allowed = np.abs(np.diff(delayed, 2)) + A * (1 + 1e-3)
    assert np.all((np.abs(np.diff(here, 2)) <= allowed)[both])
