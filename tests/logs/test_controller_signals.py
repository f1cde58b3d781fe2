"""A controller's own signals beside the pair: planned position, command of the loop, following error, contour."""

import json
from pathlib import Path

import numpy as np
import pytest
from log_files import Columns, capture, write
from places import SINUMERIK

from hybridsep.base.signals import Array
from hybridsep.logs.columns import channels
from hybridsep.logs.controller import controller_of
from hybridsep.logs.formats import open_source
from hybridsep.logs.log import read_log
from hybridsep.logs.units import shown_in

N, T_S = 400, 2e-3
SIGNALS = ("planned_position", "loop_command", "following_error", "contour_deviation")


def later(x: Array, n: int) -> Array:
    return np.concatenate((np.full(n, x[0]), x[: len(x) - n]))


def signals(scale: float = 1.0) -> Columns:
    """Return a rapid, mm: the loop's command is the mean of the plan 6 and 7 samples before, the axis follows it."""
    plan = scale * 10.0 * (1.0 - np.cos(np.pi * np.clip(np.arange(N) - 100, 0, 150) / 150))
    command = 0.5 * (later(plan, 6) + later(plan, 7))
    x = 0.7 * command + 0.3 * later(command, 1)
    return {
        "ENC_POS|1": x,
        "DES_POS|1": plan,
        "CTRL_POS|1": command,
        "CTRL_DIFF|1": command - x,
        "CONT_DEV|1": 0.5 * (command - x),
        "DES_POS|2": plan,
        "ENC_POS|2": plan,
    }


def recorded(path: Path, data: Columns, axes: tuple[str, ...] = ()) -> Path:
    path.write_text(json.dumps(capture({"CYCLE": np.arange(N), **data}, ("Cycle", *axes) if axes else ())))
    return path


def test_signals_of_a_capture_and_of_a_table(tmp_path: Path) -> None:
    data = signals()
    axes = tuple("X1" if name.endswith("1") else "Y1" for name in data)
    for log in (
        read_log(recorded(tmp_path / "capture.json", data, axes), axis="X1"),
        read_log(data, axis="1", unit="mm", T_s=T_S),
        read_log(write(tmp_path / "log.csv", data), unit="mm", T_s=T_S),
    ):
        assert tuple(log.columns.values()) == ("CTRL_POS|1", "ENC_POS|1")
        assert tuple(log.signals) == SIGNALS
        for what, name in zip(SIGNALS, ("DES_POS|1", "CTRL_POS|1", "CTRL_DIFF|1", "CONT_DEV|1"), strict=True):
            np.testing.assert_allclose(log.signals[what], 1e-3 * data[name], rtol=1e-12)
    assert tuple(read_log(data, axis="2", unit="mm", T_s=T_S).signals) == ("planned_position",)
    assert read_log({"x_d": data["DES_POS|1"], "x": data["ENC_POS|1"]}, T_s=T_S).signals == {}


def test_signals_are_listed(tmp_path: Path) -> None:
    found = {one.name: one.role for one in channels(open_source(write(tmp_path / "log.csv", signals())))}
    roles = {"DES_POS|1": "planned_position", "CTRL_POS|1": "x_d", "ENC_POS|1": "x", "CTRL_DIFF|1": "following_error"}
    assert {name: found[name] for name in roles} == roles


def test_a_signal_may_state_a_unit_of_its_own_and_be_missing() -> None:
    data = signals()
    data["CTRL_DIFF|1 [um]"] = 1e3 * data.pop("CTRL_DIFF|1")
    data["CONT_DEV|1"] = np.full(N, np.nan)
    log = read_log(data, unit="mm", T_s=T_S)
    np.testing.assert_allclose(log.signals["following_error"], log.x_d - log.x_meas, atol=1e-15)
    assert "contour_deviation" not in log.signals


def test_remedies_keep_signals_beside_the_pair() -> None:
    """And miss what was not recorded."""
    rows = np.delete(np.arange(N), [120, 121])
    data = {"t": T_S * rows, **{name: values[rows] for name, values in signals().items()}}
    for delay, resample in ((0, False), (3, False), (0, True)):
        log = read_log(data, unit="mm", delay=delay, resample=resample)
        assert len(log.x_d) == N - delay
        command = log.signals["loop_command"]
        known = np.isfinite(command)
        assert len(command) - known.sum() == 2
        np.testing.assert_array_equal(command[known], log.x_d[known])


def test_figures_and_words() -> None:
    data = signals()
    found = controller_of([read_log(data, axis="1", unit="mm", T_s=T_S)])
    assert found is not None
    assert (found.T_s, found.delay, found.look_ahead) == (T_S, 7, 6)
    for size, values in (
        (found.behind_plan, data["DES_POS|1"] - data["ENC_POS|1"]),
        (found.without_delay, data["DES_POS|1"][:-7] - data["ENC_POS|1"][7:]),
        (found.following_error, data["CTRL_DIFF|1"]),
        (found.contour_deviation, data["CONT_DEV|1"]),
    ):
        assert size is not None
        expected = 1e-3 * np.sqrt(np.mean(values**2)), 1e-3 * np.abs(values).max()
        assert (size.rms, size.largest) == pytest.approx(expected, rel=1e-9)
    delay, following, contour, ahead = found.lines(shown_in("mm"), 50)
    assert "(DES_POS) leads the measured one by 7 samples (14 ms)" in delay
    assert following.startswith("following error (CTRL_DIFF): ")
    assert contour.startswith("contour deviation (CONT_DEV): ")
    words = "(CTRL_POS) by 6 samples (12 ms); a compensation that is added to that command has these of its Np = 50"
    assert words in ahead


def test_without_the_command_of_the_loop_the_delay_is_all_that_is_known() -> None:
    log = read_log({name: signals()[name] for name in ("DES_POS|1", "ENC_POS|1")}, unit="mm", T_s=T_S)
    found = controller_of([log])
    assert found is not None
    assert (log.columns["x_d"], found.delay, found.look_ahead) == ("DES_POS|1", 7, None)
    assert found.lines(log.shown, 50)[-1].endswith("CTRL_POS would say it")
    assert controller_of([log, read_log({"x_d": log.x_d, "x": log.x_meas}, T_s=T_S)]) is None


def test_a_rotary_axis_wraps_each_signal_at_its_own_time() -> None:
    data = {name: np.mod(values, 360.0) for name, values in signals(40.0).items() if name[:3] in ("ENC", "DES", "CTR")}
    data["CTRL_DIFF|1"] = signals(40.0)["CTRL_DIFF|1"]
    found = controller_of([read_log(data, axis="1", unit="deg", T_s=T_S)])
    assert found is not None
    assert (found.delay, found.look_ahead) == (7, 6)
    assert found.behind_plan is not None
    assert found.behind_plan.largest < 1.5


@pytest.mark.skipif(not SINUMERIK.parent.is_dir(), reason="needs ../shared/cases/sinumerik beside the repository")
@pytest.mark.parametrize(("axis", "behind", "following"), [("1", 381, 51), ("2", 424, 58), ("3", 1522, 207)])
def test_a_rapid_of_a_milling_machine(axis: str, behind: float, following: float) -> None:
    found = controller_of([read_log(SINUMERIK, axis=axis, T_s=T_S, unit="mm")])
    assert found is not None
    assert (found.delay, found.look_ahead) == (6, 6)
    assert found.behind_plan is not None
    assert found.following_error is not None
    assert (1e6 * found.behind_plan.rms, 1e6 * found.following_error.rms) == pytest.approx((behind, following), abs=0.5)
