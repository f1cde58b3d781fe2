"""The C core against the Python library, which is the readable truth; each test states its tolerance."""

from __future__ import annotations

import ctypes
import math
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import c_core
import mpmath
import numpy as np
import oracle
import pytest
import staircase_data as staircase
from c_core import CModel, RefusedError
from numpy.typing import NDArray

from hybridsep.errors import FmuError, HybridSepError
from hybridsep.fmi.clock import SampleClock
from hybridsep.fmi.variables import modes_from
from hybridsep.lookahead import LookAhead
from hybridsep.parameters import check, check_together
from hybridsep.physics import ModalModel, Mode
from hybridsep.plant import Encoder, FeedDrive, Plant, StageDrive
from hybridsep.predictor import HybridPredictor
from hybridsep.regression import RidgeRegression

Array = NDArray[np.float64]
LongArray = NDArray[np.longdouble]
TS = 1e-3
OUTPUTS = ("x_d", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h")

MODES = {
    "under-damped": (25.0, 0.05, 24674.0, 15.7),
    "lightly damped": (37.0, 0.01, 102687.3, 8.83),
    "critical": (19.0, 1.0, 14412.0, 0.0),
    "nearly critical": (19.0, 1.0 + 1e-9, 14412.0, 30.0),
    "over-damped": (30.0, 4.0, 35530.0, 10.0),
    "stiff": (300.0, 50.0, 3.5e6, 100.0),
    "slow": (1e-3, 0.7, 3.9e-5, 0.0),
    "near the sampling rate": (480.0, 0.1, 9.1e6, 0.0),
}


# Physics ---------------------------------------------------------------------------------------------------------


class DiscreteMode(ctypes.Structure):
    """hsep_discrete_mode."""

    _fields_ = tuple((name, ctypes.c_double * n) for name, n in (("A", 4), ("b", 2), ("c", 2), ("d", 1), ("s", 2)))


def c_mode(*numbers: float) -> Any:
    return (ctypes.c_double * len(numbers))(*numbers)


class CPhysics:
    """hsep_physics."""

    def __init__(self, modes: list[tuple[float, float, float, float]], dead_time: int, hold: str) -> None:
        self.library = c_core.library("predictor")
        n, d = ctypes.c_uint64(len(modes)), ctypes.c_uint64(dead_time)
        self.block = np.zeros(int(self.library.hsep_physics_size(n, d)) // 8)
        flat = c_mode(*(number for mode in modes for number in mode))
        self.library.hsep_physics_init(self._block, flat, n, d, ctypes.c_double(TS), ctypes.c_int(hold == "foh"))

    @property
    def _block(self) -> Any:
        return self.block.ctypes.data_as(ctypes.c_void_p)

    def respond(self, x_d: Array) -> Array:
        x_pb = np.empty_like(x_d)
        pointers = (x_d.ctypes.data_as(ctypes.c_void_p), x_pb.ctypes.data_as(ctypes.c_void_p))
        self.library.hsep_physics_respond(self._block, *pointers, ctypes.c_size_t(len(x_d)))
        return x_pb


def exact_matrices(f_n: float, zeta: float, alpha: float, beta: float, hold: str) -> dict[str, LongArray]:
    """Return A, b, c, d of one mode between samples, eq. (15), from forty digits."""
    with mpmath.workdps(40):
        w = 2 * mpmath.pi * mpmath.mpf(f_n)
        M = mpmath.zeros(4)
        M[0, 1], M[1, 0], M[1, 1] = w * TS, -w * TS, -2 * mpmath.mpf(zeta) * w * TS
        M[1, 2], M[2, 3] = w * TS, 1
        exponential = mpmath.expm(M)
        A, g1, g2 = exponential[:2, :2], exponential[:2, 2], exponential[:2, 3]
        c = mpmath.matrix([[mpmath.mpf(alpha) / w**2, mpmath.mpf(beta) / w]])
        b, d = (g1, mpmath.zeros(1)) if hold == "zoh" else (A * g2 + g1 - g2, c * g2)
        texts = {name: [mpmath.nstr(x, 30) for x in part] for name, part in (("A", A), ("b", b), ("c", c), ("d", d))}
    shapes = {"A": (2, 2), "b": (2,), "c": (2,), "d": (1,)}
    return {name: np.array([np.longdouble(x) for x in part]).reshape(shapes[name]) for name, part in texts.items()}


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("damping", list(MODES))
def test_a_mode_is_discretised_to_the_last_digits(damping: str, hold: str) -> None:
    # Against forty digits: each matrix to 1e-14 of its largest entry, the entries that are not tiny to 1e-13 of
    # themselves.
    f_n, zeta, alpha, beta = MODES[damping]
    mode = DiscreteMode()
    c_core.library("predictor").hsep_discretise(
        ctypes.byref(mode), c_mode(f_n, zeta, alpha, beta), ctypes.c_double(TS), ctypes.c_int(hold == "foh")
    )
    for name, entries in exact_matrices(f_n, zeta, alpha, beta, hold).items():
        got, expected = np.array(getattr(mode, name)), entries.ravel().astype(float)
        np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-14 * np.max(np.abs(expected)), err_msg=name)
    np.testing.assert_array_equal(np.array(mode.s), 0.0)


@pytest.mark.parametrize("dead_time", [0, 1, 7, 130])
@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("damping", list(MODES))
def test_the_physics_model_answers_as_the_library_does(damping: str, hold: str, dead_time: int) -> None:
    # 1e-14 of the largest position for each ten samples that a mode remembers, rounding of A accumulating over them;
    # 1e-12 for the stiff mode, where SciPy's expm is the one that loses digits (2e-13, the core 2e-15).
    modes = [MODES[damping], (98.0, 0.05, 5000.0, 0.0)]
    x_d = staircase.commanded()[:1200]
    discrete = ModalModel([Mode(*mode) for mode in modes], dead_time).discretise(TS, hold)
    expected, _ = discrete.respond(discrete.rest(), x_d)
    core = CPhysics(modes, dead_time, hold)
    got = np.concatenate((core.respond(x_d[:1]), core.respond(x_d[1:500]), core.respond(x_d[500:])))
    tolerance = 1e-12 if damping == "stiff" else remembered(modes)
    assert np.max(np.abs(got - expected)) <= tolerance * np.max(np.abs(expected))


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("damping", list(MODES))
def test_the_physics_model_answers_as_extended_precision_does(damping: str, hold: str) -> None:
    # As above, against a recursion in long double with exact matrices.
    mode = MODES[damping]
    exact = exact_matrices(*mode, hold)
    x_d = staircase.commanded()[:1200]
    s, expected = np.zeros(2, dtype=np.longdouble), []
    for u in x_d:
        expected.append(exact["c"] @ s + exact["d"][0] * u)
        s = exact["A"] @ s + exact["b"] * u
    got = CPhysics([mode], 0, hold).respond(x_d)
    error = np.max(np.abs(got - np.array(expected)))
    assert error <= remembered([mode]) * np.max(np.abs(got))


def remembered(modes: list[tuple[float, float, float, float]]) -> float:
    """Return 1e-14 for each ten samples of the slowest decay, of at most 1200."""
    slowest = [min(zeta, 1 / (2 * zeta)) * 2 * np.pi * f_n * TS for f_n, zeta, _, _ in modes]
    return 1e-14 * max(1.0, min(1200.0, 1 / min(slowest)) / 10)


# Regression ------------------------------------------------------------------------------------------------------


class CRegression:
    """hsep_regression."""

    def __init__(self, n: int, lam: float) -> None:
        self.library, self.n = c_core.library("predictor"), n
        self.block = np.zeros(int(self.library.hsep_regression_size(ctypes.c_uint64(n))) // 8)
        self.library.hsep_regression_init(self._block, ctypes.c_uint64(n), ctypes.c_double(lam))

    @property
    def _block(self) -> Any:
        return self.block.ctypes.data_as(ctypes.c_void_p)

    def fold(self, rows: Array, target: Array, repetitions: int = 1) -> None:
        stacked = np.ascontiguousarray(np.column_stack((rows, target)))
        pointer = stacked.ctypes.data_as(ctypes.c_void_p)
        self.library.test_fold(self._block, pointer, ctypes.c_size_t(len(rows)), ctypes.c_size_t(repetitions))

    def load(self, i: int, row: Array) -> int:
        place = self.library.hsep_regression_row(self._block)
        for j, value in enumerate(row.tolist()):
            place[j] = value
        done: int = self.library.hsep_regression_load(self._block, ctypes.c_uint64(i))
        return done

    @property
    def weights(self) -> Array:
        w = np.empty(self.n)
        self.library.hsep_regression_solve(self._block, w.ctypes.data_as(ctypes.c_void_p))
        return w

    @property
    def residual_sum(self) -> float:
        return float(self.block[3])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 9, 16, 23])
@pytest.mark.parametrize("lam", [1e-12, 1e-3, 10.0])
def test_weights_of_random_rows_are_those_of_the_direct_solution(n: int, lam: float) -> None:
    # 1e-11 relative against long double; from one row, less than features, to many.
    rng = np.random.default_rng(n)
    rows = rng.normal(size=(200, n))
    target = rows @ rng.normal(size=n) + 0.1 * rng.normal(size=200)
    regression, library = CRegression(n, lam), RidgeRegression(n, lam)
    done = 0
    for m in (0, 1, 2, 30, 200):
        regression.fold(rows[done:m], target[done:m])
        library.update(rows[done:m], target[done:m])
        done = m
        exact = oracle.ridge_extended(rows[:m], target[:m], lam).astype(float)
        scale = 1e-11 * max(float(np.linalg.norm(exact)), 1e-300)
        np.testing.assert_allclose(regression.weights, exact, rtol=0, atol=max(scale, 1e-14 / math.sqrt(lam) * (m < n)))
        assert regression.residual_sum == pytest.approx(library.residual_sum, rel=1e-9, abs=1e-11 * max(lam, 1e-3))


def test_rows_that_outweigh_all_before_them_lose_nothing() -> None:
    # Each row a million times the one before and nearly parallel to it: rotations with a cosine near 0, where the
    # cheap form of the update would be wrong. 1e-9 relative.
    rng = np.random.default_rng(1)
    n, m = 6, 60
    base = rng.normal(size=n)
    rows = (base + 1e-3 * rng.normal(size=(m, n))) * (10.0 ** np.tile([-6.0, 0.0, 6.0], m // 3))[:, None]
    target = rows @ rng.normal(size=n) * (1 + 1e-2 * rng.normal(size=m))
    regression = CRegression(n, 1e-6)
    regression.fold(rows, target)
    exact = oracle.ridge_extended(rows, target, 1e-6).astype(float)
    assert np.linalg.norm(regression.weights - exact) <= 1e-9 * np.linalg.norm(exact)


def staircase_rows(p: int, q: int, n: int) -> tuple[Array, Array]:
    """Return rows of features, (n, 2 + q + p), and their targets, (n,), of the measured staircase; eq. (5)."""
    discrete = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0).discretise(TS)
    x_pb, _ = discrete.respond(discrete.rest(), staircase.commanded())
    e_pb = staircase.measured(0) - x_pb
    first = 200  # the lags before it are there
    columns = [np.ones(n)] + [x_pb[first - i : first - i + n] for i in range(q + 1)]
    columns += [e_pb[first - i : first - i + n] for i in range(1, p + 1)]
    return np.column_stack(columns), e_pb[first : first + n]


def test_the_weights_keep_their_digits_over_a_million_samples() -> None:
    # n = 55: 1e-9 relative against extended precision. m times the same rows are the rows times sqrt(m).
    rows, target = staircase_rows(50, 3, 5000)
    regression = CRegression(55, 1e-12)
    regression.fold(rows, target, repetitions=200)
    scale = np.sqrt(np.longdouble(200))
    exact = oracle.ridge_extended(
        (rows * scale).astype(np.longdouble),
        (target * scale).astype(np.longdouble),
        1e-12,
    )
    error = np.linalg.norm((regression.weights - exact).astype(float)) / np.linalg.norm(exact.astype(float))
    assert error <= 1e-9


def test_a_loaded_factor_is_the_one_it_was() -> None:
    # 1e-9 relative between weights before and after, and after more rows.
    rows, target = staircase_rows(5, 2, 400)
    library, regression = RidgeRegression(9, 1e-9), CRegression(9, 1.0)
    library.update(rows[:300], target[:300])
    for i in range(10):
        assert regression.load(i, library.factor[i, i:]) == 1
    np.testing.assert_allclose(regression.weights, library.weights, rtol=1e-9)
    library.update(rows[300:], target[300:])
    regression.fold(rows[300:], target[300:])
    np.testing.assert_allclose(regression.weights, library.weights, rtol=1e-9)
    assert regression.residual_sum == pytest.approx(library.residual_sum, rel=1e-12)


def test_a_factor_that_is_none_is_refused_unchanged() -> None:
    regression = CRegression(3, 1.0)
    regression.fold(np.eye(3), np.arange(3.0))
    before = regression.weights
    assert regression.load(1, np.array([0.0, 1.0, 1.0])) == 0
    assert regression.load(1, np.array([1.0, math.nan, 1.0])) == 0
    np.testing.assert_array_equal(regression.weights, before)


# The predictor ---------------------------------------------------------------------------------------------------


def look_ahead(name: str, **parameters: float) -> tuple[LookAhead, CModel]:
    """Return the library's look-ahead and the C model with the same parameters, start included."""
    start = parameters.pop("start", 0.0)
    values = {**c_core.PREDICTOR, **parameters}
    model = ModalModel([Mode(**mode) for mode in c_core.DESCRIPTIONS[name]["modes"]], int(values["dead_time"]))
    known = {key: value for key, value in values.items() if key != "dead_time"}
    predictor = HybridPredictor.with_parameters(model, known)
    return LookAhead(predictor, start), CModel(name, {**values, "x_d_ahead": start, "x_meas": start}).initialise()


def compare_runs(ahead: LookAhead, model: CModel, x_d: Array, x: Array, tolerance: float) -> None:
    """Step both through a run, wired as section 4 has it, and compare every output at every sample."""
    period = float(model["T_s"])
    for k in range(len(x_d)):
        measured = float(x[k - ahead.Np]) if k >= ahead.Np else float(x_d[0])
        ahead.sample(float(x_d[k]), measured)
        model["x_d_ahead"], model["x_meas"] = float(x_d[k]), measured
        model.step(k * period, period)
        for name in OUTPUTS:
            assert abs(model[name] - getattr(ahead, name)) <= tolerance, (name, k)
        assert model["batch"] == ahead.batch
        assert bool(model["hybrid_active"]) == ahead.hybrid_active
        if k % 50 == 49:
            for name in ("x_d_window", "x_pb_window", "x_h_window"):
                shown = np.zeros(100)
                shown[: ahead.Np] = getattr(ahead, name)[:100]
                np.testing.assert_allclose(model.window(name), shown, rtol=0, atol=tolerance)


@pytest.mark.parametrize("start", [0.0, 0.1])
@pytest.mark.parametrize(("p", "q"), [(50, 3), (100, 99)])
def test_the_staircase_is_predicted_as_by_the_library(p: int, q: int, start: float) -> None:
    # 1e-11 m at every sample.
    ahead, model = look_ahead("predictor", p=p, q=q, start=start)
    compare_runs(ahead, model, staircase.commanded() + start, staircase.measured(0) + start, 1e-11)
    assert 5e-6 < model["rms_h"] < 1.5e-5


@pytest.mark.parametrize(
    "parameters",
    [
        {"Np": 7, "p": 7, "q": 6},
        {"Np": 1, "p": 1, "q": 0},
        {"Np": 30, "p": 2, "q": 1, "t_init": 0.0},
        {"p": 10, "q": 2, "t_init": 0.2505, "lambda": 1e-9},
        {"p": 10, "input_hold": 1, "dead_time": 3},
        {"p": 10, "dead_time": 150, "t_init": 1e9},
        {"T_s": 2e-3, "p": 20},
    ],
)
def test_other_parameters_are_predicted_as_by_the_library(parameters: dict[str, float]) -> None:
    # 1e-11 m at every sample, of a stage with two modes.
    n = 1500
    ahead, model = look_ahead("predictor_2", **parameters)
    compare_runs(ahead, model, staircase.commanded()[:n], staircase.measured(1)[:n], 1e-11)


def test_sub_steps_give_what_whole_steps_give() -> None:
    whole, parts = (CModel("predictor", {"p": 10}).initialise(2.5) for _ in range(2))
    for k in range(400):
        x_d, x = float(staircase.commanded()[k]), float(staircase.measured(0)[k])
        whole["x_d_ahead"], whole["x_meas"] = parts["x_d_ahead"], parts["x_meas"] = x_d, x
        whole.step(2.5 + k * TS)
        for part in range(4):
            assert parts["x_h"] == pytest.approx(parts["x_h"])
            before = parts["x_h"]
            parts.step(2.5 + k * TS + part * TS / 4, TS / 4)
            if part < 3:
                assert parts["x_h"] == before
            parts["x_d_ahead"], parts["x_meas"] = math.nan, math.nan  # not read before the next sample
        np.testing.assert_array_equal(
            [whole[name] for name in OUTPUTS], [parts[name] for name in OUTPUTS], err_msg=str(k)
        )


def test_the_outputs_before_and_right_after_initialization_are_those_of_t_0() -> None:
    model = CModel("predictor", {"x_d_ahead": 0.25, "Np": 60})
    model.start_values()
    before = model.values.copy()
    assert model["x_d"] == model["x_pb"] == model["x_h"] == 0.25
    np.testing.assert_array_equal(model.window("x_h_window"), [0.25] * 60 + [0.0] * 40)
    np.testing.assert_array_equal(model.initialise().values, before)


def test_learned_weights_from_the_resources_predict_at_once(tmp_path: Path) -> None:
    # 1e-11 m against the library's second run with the weights kept.
    x_d, x = staircase.commanded()[:1500], staircase.measured(0)[:1500]
    ahead, _ = look_ahead("predictor", p=20, t_init=0.0)
    for k in range(len(x_d)):
        ahead.sample(float(x_d[k]), float(x[max(k - 100, 0)]))
    regression = ahead.predictor.regression
    write_weights(tmp_path, regression.factor, regression.n_samples)
    second = LookAhead(ahead.predictor, 0.0)
    model = CModel("predictor", {"p": 20, "t_init": 0.0}, tmp_path).initialise()
    assert np.max(np.abs(second.predictor.weights)) > 0.01
    compare_runs(second, model, x_d, x, 1e-11)


def write_weights(folder: Path, factor: Array, n_samples: int) -> None:
    n = len(factor) - 1
    triangle = np.concatenate([factor[i, i:] for i in range(n + 1)])
    (folder / "weights.bin").write_bytes(
        b"HSEPWGT1" + struct.pack("<QQ", n, n_samples) + triangle.astype("<f8").tobytes()
    )


# Plants, encoder, trajectory -------------------------------------------------------------------------------------


def plants() -> dict[str, Plant]:
    stage = ModalModel([Mode(**mode) for mode in c_core.STAGE_MODES])
    return {
        "feed_drive": FeedDrive(*(c_core.FEED_DRIVE[name] for name in ("m", "c", "k", "c_nl", "k_nl"))),
        "stage_drive": StageDrive(stage, c_core.STAGE_DRIVE["f"], c_core.STAGE_DRIVE["kappa"], 1e-3),
    }


@pytest.mark.parametrize("h", [1e-3, 0.25e-3, 2.5e-3, 0.7e-4])
@pytest.mark.parametrize("name", ["feed_drive", "stage_drive"])
def test_the_plants_move_as_the_librarys_do(name: str, h: float) -> None:
    # 1e-12 m in position, 1e-10 m/s in velocity, 1e-12 m in the measurement.
    plant = plants()[name]
    parameters = c_core.DESCRIPTIONS[name]["parameters"]
    encoder = Encoder(parameters["noise_std"], parameters["seed"])
    plant.reset(0.1)
    model = CModel(name, {"x_d": 0.1})
    model.start_values()
    before = model.values.copy()
    np.testing.assert_array_equal(model.initialise().values, before)
    assert abs(model["x_meas"] - encoder.measure(plant.x)) <= 1e-12
    for k, command in enumerate((staircase.commanded()[:1200] + 0.1).tolist()):
        model["x_d"] = command
        model.step(k * h, h)
        plant.step(command, h)
        assert abs(model["x"] - plant.x) <= 1e-12
        assert abs(model["v"] - plant.v) <= 1e-10
        assert abs(model["x_meas"] - encoder.measure(plant.x)) <= 1e-12


@pytest.mark.parametrize("seed", [0, 1, 12345, 2**31 - 1])
def test_the_encoder_draws_the_librarys_numbers(seed: int) -> None:
    # 1e-15 relative to the standard deviation's largest multiple, 8.6.
    encoder, measure = Encoder(1.0, seed), c_core.library("feed_drive").hsep_encoder_measure
    core = (ctypes.c_uint64 * 3)(*struct.unpack("<Q", struct.pack("<d", 1.0)), seed, 0)
    for _ in range(2000):
        assert measure(core, ctypes.c_double(0.0)) == pytest.approx(encoder.measure(0.0), rel=1e-15, abs=1e-15)


def write_trajectory(folder: Path, samples: Array, T_s: float = TS) -> None:
    head = b"HSEPTRJ1" + struct.pack("<Qd", len(samples), T_s)
    (folder / "trajectory_3.bin").write_bytes(head + samples.astype("<f8").tobytes())


def test_a_trajectory_is_played_and_held_at_its_end(tmp_path: Path) -> None:
    samples = staircase.commanded()[:300] + 0.02
    write_trajectory(tmp_path, samples)
    model = CModel("trajectory", resources=tmp_path)
    model.start_values()
    assert model["r"] == samples[0]
    model.initialise(1.0)
    assert model["r"] == samples[0]
    for k in range(400):
        model.step(1.0 + k * TS, TS / 2)
        assert model["r"] == samples[min(k, 299)]
        model.step(1.0 + (k + 0.5) * TS, TS / 2)
        assert model["r"] == samples[min(k + 1, 299)]


# States ----------------------------------------------------------------------------------------------------------


def steppable(name: str, folder: Path) -> tuple[CModel, Callable[[int], None]]:
    """Return an initialised model and what steps it at sample k with inputs of its own."""
    write_trajectory(folder, staircase.commanded()[:2000])
    model = CModel(name, resources=folder).initialise()

    def step(k: int) -> None:
        for key, values in (("x_d_ahead", staircase.commanded()), ("x_d", staircase.commanded())):
            if key in model.place and not (key == "x_d" and "x_d_ahead" in model.place):
                model[key] = float(values[k])
        if "x_d_ahead" in model.place:
            model["x_meas"] = float(staircase.measured(0)[k])
        model.step(k * TS)

    return model, step


@pytest.mark.parametrize("name", ["predictor", "predictor_2", "feed_drive", "stage_drive", "trajectory"])
def test_a_run_from_a_saved_state_is_the_same_to_the_last_bit(name: str, tmp_path: Path) -> None:
    model, step = steppable(name, tmp_path)
    other, step_other = steppable(name, tmp_path)
    for k in range(250):
        step(k)
    state, values = model.state.copy(), model.values.copy()
    model.check_state(state.tobytes())
    seen = []
    for k in range(250, 520):
        step(k)
        seen.append(model.values.copy())
    other.state[:], other.values[:] = state, values
    for k in range(250, 520):
        step_other(k)
        np.testing.assert_array_equal(other.values, seen[k - 250])
    assert other.state.tobytes() == model.state.tobytes()


@pytest.mark.parametrize("name", ["predictor", "feed_drive", "stage_drive", "trajectory"])
def test_foreign_truncated_and_damaged_states_are_refused(name: str, tmp_path: Path) -> None:
    model, step = steppable(name, tmp_path)
    step(0)
    blob = model.state.tobytes()
    with pytest.raises(RefusedError, match=f"must have {len(blob)} bytes, got {len(blob) - 8}; it is truncated"):
        model.check_state(blob[:-8])
    with pytest.raises(RefusedError, match=r"must have \d+ bytes, got 0"):
        model.check_state(b"")
    with pytest.raises(RefusedError, match="belongs to another model"):
        model.check_state(b"\x00" + blob[1:])
    with pytest.raises(RefusedError, match="must be of version 1, got 2"):
        model.check_state(blob[:8] + struct.pack("<Q", 2) + blob[16:])
    with pytest.raises(RefusedError, match="saved with other parameters"):
        model.check_state(blob[:24] + struct.pack("<Q", 2) + blob[32:])
    if name != "feed_drive":  # its state has no numbers that must fit together
        middle = {"predictor": 32 + 40 + 16, "stage_drive": 32 + 24 + 64, "trajectory": 32 + 40}[name]
        with pytest.raises(RefusedError, match="does not hold together"):
            model.check_state(blob[:middle] + struct.pack("<Q", 2**60) + blob[middle + 8 :])


def test_a_state_of_other_parameters_is_refused() -> None:
    blob = CModel("predictor", {"lambda": 1e-9}).initialise().state.tobytes()
    with pytest.raises(RefusedError, match="saved with other parameters"):
        CModel("predictor").initialise().check_state(blob)


# Refusals --------------------------------------------------------------------------------------------------------


def refusal(action: Callable[[], Any]) -> str:
    with pytest.raises(RefusedError) as caught:
        action()
    return str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"Np": 0},
        {"Np": 100_001},
        {"p": 120},
        {"q": 100, "p": 101},
        {"p": 0, "lambda": 0.0},
        {"lambda": -1e-12, "T_s": 0.0, "t_init": -0.25},
        {"lambda": math.nan},
        {"lambda": math.inf},
        {"T_s": -math.inf},
        {"T_s": 1e-300, "t_init": 1e300},
        {"t_init": -1e22},
        {"T_s": -123456.789},
        {"lambda": -1e16},
        {"lambda": -5e-324},
    ],
)
def test_bad_parameters_are_refused_in_the_librarys_words(wrong: dict[str, float]) -> None:
    names = {"lambda": "lam", "T_s": "Ts"}
    given: Any = {key: wrong.get(key, c_core.PREDICTOR[key]) for key in ("Np", "p", "q", "lambda", "T_s", "t_init")}
    with pytest.raises(HybridSepError) as caught:
        check_together(**{names.get(key, key): value for key, value in given.items()})
    assert refusal(CModel("predictor", wrong).size) == str(caught.value)
    assert refusal(CModel("predictor", wrong).initialise) == str(caught.value)


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("predictor", "input_hold", 2),
        ("predictor", "dead_time", -1),
        ("feed_drive", "m", 0.0),
        ("feed_drive", "k", -24674.0),
        ("feed_drive", "c_nl", -1.0),
        ("feed_drive", "noise_std", math.nan),
        ("feed_drive", "seed", -1),
        ("stage_drive", "kappa", -0.5),
        ("stage_drive", "T_s", 0.0),
        ("trajectory", "trajectory", 4),
    ],
)
def test_a_parameter_alone_is_refused_in_the_librarys_words(name: str, parameter: str, value: float) -> None:
    with pytest.raises(HybridSepError) as caught:
        check(parameter, value)
    assert refusal(CModel(name, {parameter: value}).size) == str(caught.value)


@pytest.mark.parametrize("name", ["predictor_2", "stage_drive"])
def test_a_modes_parameter_is_refused_with_its_place(name: str) -> None:
    model = CModel(name, {"mode[2].zeta": 0.0})
    with pytest.raises(HybridSepError) as caught:
        modes_from({key: model[key] for key in model.place if key.startswith("mode[")})
    assert refusal(model.size) == str(caught.value)


def test_a_number_that_is_not_whole_is_refused() -> None:
    assert refusal(CModel("predictor", {"p": 2.5}).size) == "p must be a whole number, got 2.5"


def test_many_problems_are_cut_off_within_the_message() -> None:
    wrong = {key: math.nan for key in CModel("predictor_2").place if key.startswith("mode[") or key in c_core.PREDICTOR}
    message = refusal(CModel("predictor_2", wrong).size)
    assert message.startswith("Np must be finite, got nan; p must be finite, got nan; ")
    message = refusal(CModel("predictor_2", dict.fromkeys(wrong, -1.2345678901234567e-5)).size)
    assert 450 < len(message.encode()) < c_core.MESSAGE_SIZE


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused_and_change_nothing(value: float) -> None:
    text = str(value)
    assert refusal(CModel("predictor", {"x_d_ahead": value}).initialise) == (
        f"the start value of x_d_ahead must be finite, got {text}"
    )
    assert refusal(CModel("feed_drive", {"x_d": value}).initialise) == (
        f"the start value of x_d must be finite, got {text}"
    )
    assert refusal(lambda: CModel("predictor").initialise(value)) == f"the start time must be finite, got {text} s"
    for name, variable, message in (
        ("predictor", "x_d_ahead", f"x_d_ahead must be finite, got {text} at sample 1"),
        ("predictor", "x_meas", f"x_meas must be finite, got {text} at sample 1"),
        ("feed_drive", "x_d", f"x_d must be finite, got {text} at t = 0.001 s"),
        ("stage_drive", "x_d", f"x_d must be finite, got {text} at t = 0.001 s"),
    ):
        model = CModel(name).initialise()
        model.step(0.0)
        state = model.state.tobytes()
        model[variable] = value
        values = model.values.copy()
        assert refusal(lambda model=model: model.step(TS)) == message  # type: ignore[misc]
        assert model.state.tobytes() == state
        np.testing.assert_array_equal(model.values, values)


@pytest.mark.parametrize(
    ("t", "h"), [(0.001, 0.0), (0.001, -1e-3), (0.001, 2e-3), (0.001, 0.6e-3), (0.001, math.nan), (0.001, math.inf)]
)
def test_other_step_sizes_are_refused_in_the_librarys_words(t: float, h: float) -> None:
    with pytest.raises(FmuError) as caught:
        SampleClock(0.0, TS, k=1).check(t, h)
    model = CModel("predictor").initialise()
    model.step(0.0)
    state = model.state.tobytes()
    assert refusal(lambda: model.step(t, h)) == str(caught.value)
    assert model.state.tobytes() == state


def test_other_communication_points_are_refused_in_the_librarys_words() -> None:
    clock, model = SampleClock(1.5, TS), CModel("predictor").initialise(1.5)
    for t in (0.0, 1.501, math.nan):
        with pytest.raises(FmuError) as caught:
            clock.check(t, TS)
        assert refusal(lambda t=t: model.step(t)) == str(caught.value)  # type: ignore[misc]
    clock.advance(clock.check(1.5, TS / 2))
    model.step(1.5, TS / 2)
    for t, h in ((1.5, TS / 2), (1.5005, TS / 4)):
        with pytest.raises(FmuError) as caught:
            clock.check(t, h)
        assert refusal(lambda t=t, h=h: model.step(t, h)) == str(caught.value)  # type: ignore[misc]


@pytest.mark.parametrize("name", ["feed_drive", "stage_drive"])
def test_steps_that_a_plant_cannot_do_are_refused(name: str) -> None:
    model = CModel(name, {"x_d": 0.0}).initialise()
    state = model.state.tobytes()
    for t, h, message in (
        (0.0, 0.0, "the step size must be finite and > 0 s, got 0.0"),
        (0.0, -1.0, "the step size must be finite and > 0 s, got -1.0"),
        (0.0, math.nan, "the step size must be finite and > 0 s, got nan"),
        (0.0, 101.0, "the step size must be at most 100 s, got 101.0; make several steps"),
        (math.inf, 1e-3, "the communication point must be finite, got inf s"),
    ):
        assert refusal(lambda t=t, h=h: model.step(t, h)) == message  # type: ignore[misc]
    model["x_d"] = 1e308
    assert "state left the range of numbers" in refusal(lambda: model.step(0.0, 1e-2))
    assert model.state.tobytes() == state


def test_resources_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "trajectory_3.bin"
    assert refusal(CModel("trajectory").size) == "trajectory_3.bin must be in the resources (none) and readable"
    assert "must be in the resources" in refusal(CModel("trajectory", resources=tmp_path).size)
    write_trajectory(tmp_path, np.arange(5.0), 2e-3)
    model = CModel("trajectory", resources=tmp_path)
    assert refusal(model.size) == "T_s must be 0.002 s, the interval of trajectory_3.bin, got 0.001"
    model.start_values()
    assert model["r"] == 0.0
    write_trajectory(tmp_path, np.array([1.0, math.nan]))
    assert refusal(model.initialise) == "trajectory_3.bin must be finite, got nan at sample 1"
    write_trajectory(tmp_path, np.arange(5.0))
    good = file.read_bytes()
    for bad in (b"", good[:20], good[:-1], good[:24], b"X" + good[1:], good + b"\0" * 8):
        file.write_bytes(bad)
        assert "it is damaged or truncated" in refusal(model.size)


def test_weights_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    factor = np.triu(np.ones((13, 13)))
    model = CModel("predictor", {"p": 7}, tmp_path)
    write_weights(tmp_path, factor, 5)
    model.initialise()
    good = (tmp_path / "weights.bin").read_bytes()
    for bad in (b"", good[:-8], b"X" + good[1:]):
        (tmp_path / "weights.bin").write_bytes(bad)
        assert "it is damaged or truncated" in refusal(model.initialise)
    factor[3, 3] = 0.0
    write_weights(tmp_path, factor, 5)
    assert "it is damaged or truncated" in refusal(model.initialise)
    write_weights(tmp_path, np.eye(9), 5)
    assert refusal(model.initialise) == (
        "weights.bin must have 2 + q + p = 12 weights, got 8; set p and q as they were learned"
    )


# The sources themselves ------------------------------------------------------------------------------------------


def test_the_core_needs_libm_alone() -> None:
    # No allocation, no file, no global: nothing but these is undefined in it, and nothing in it is writable.
    nm = shutil.which("nm") or shutil.which("llvm-nm")
    assert nm, "nm is needed to look into object files; install binutils"
    allowed = {
        "memcpy",
        "memset",
        "memcmp",
        "sqrt",
        "log",
        "cos",
        "tanh",
        "ldexp",
        "frexp",
        "floor",
        "ceil",
        "fmax",
        "fmin",
    }
    core = {path.stem for path in (c_core.C_SOURCES / "core").glob("*.c")}
    for built in c_core.object_files():
        if Path(built).stem not in core:
            continue
        lines = subprocess.run([nm, built], capture_output=True, text=True, check=True).stdout.splitlines()
        for kind, symbol in (line.split()[-2:] for line in lines):
            known = symbol in allowed or symbol.startswith(("hsep_", "_GLOBAL_OFFSET_TABLE_", "__stack_chk"))
            assert kind != "U" or known, f"{built} uses {symbol}"
            assert kind not in "bBdDC", f"{built} has the writable {symbol}"


@pytest.mark.parametrize("name", list(c_core.DESCRIPTIONS))
def test_everything_compiles_as_one_file(name: str) -> None:
    folder = c_core.build_folder() / f"all_{name}"
    c_core.write_header(name, folder)
    everything = folder / "all.c"
    everything.write_text("".join(f'#include "{source}"\n' for source in c_core.sources()))
    for level in ("-O0", "-O3"):
        c_core.run_compiler([level, f"-I{folder}", *c_core.include_flags(), "-c", everything, "-o", folder / "all.o"])


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("predictor", [[], ["Np=7", "p=7", "q=6"], ["Np=1", "p=1", "q=0"], ["Np=150", "p=2", "q=0", "dead_time=13"]]),
        ("predictor_2", [["input_hold=1", "t_init=0"], ["p=100", "q=99", "lambda=1e-300"]]),
        ("feed_drive", [[]]),
        ("stage_drive", [[]]),
        ("trajectory", [[]]),
    ],
)
def test_the_sanitisers_find_nothing(name: str, arguments: list[list[str]], tmp_path: Path) -> None:
    folder = c_core.build_folder() / f"sanitise_{name}"
    c_core.write_header(name, folder)
    flags = ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer"]
    driver = c_core.ROOT / "tests" / "c" / "sanitise.c"
    program = folder / "sanitise"
    c_core.run_compiler(
        [*flags, f"-I{folder}", *c_core.include_flags(), *c_core.sources(), driver, "-lm", "-o", program]
    )
    write_trajectory(tmp_path, staircase.commanded()[:600])
    for pairs in arguments:
        done = subprocess.run([program, f"{tmp_path}/", *pairs], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
