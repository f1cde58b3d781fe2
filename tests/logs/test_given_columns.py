"""What users hand over: masked, labelled, with units, in tables; stand-ins for pandas, polars, xarray and pint."""

import decimal
import math
from collections.abc import Mapping
from datetime import datetime, timedelta, timezone
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from log_files import refused

import hybridsep
from hybridsep.base.errors import HybridSepError, LogError, ParameterError, SignalError
from hybridsep.base.signals import as_measured, as_samples
from hybridsep.logs.log import Table, read_log
from hybridsep.logs.units import stated_unit

N = 3000
T = 1e-3 * np.arange(N)
X_D = 10.0 * (1.0 - np.cos(8.0 * T))
X = np.r_[X_D[:5] * 0.0, X_D[:-5]]
GONE = (np.arange(N) >= 1000) & (np.arange(N) < 1100)
GAPS = np.where(GONE, math.nan, X)


class Labelled:
    """Column or index with labels, as pandas' Series and Index; ``units`` as xarray's attributes."""

    def __init__(self, values: Any, index: Any = None, name: str | None = None) -> None:
        self._values, self.index, self.name = np.asarray(values), index, name

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self._values.astype(dtype) if dtype else self._values

    def __len__(self) -> int:
        return len(self._values)


class Frame:
    """Table as pandas has it, or polars' LazyFrame, where ``collect`` is called first."""

    def __init__(self, index: Any = None, **columns: Any) -> None:
        self._columns, self.index, self.columns = columns, index, list(columns)

    def __getitem__(self, name: str) -> Any:
        return Labelled(self._columns[name], self.index)


class Lazy(SimpleNamespace):
    def collect(self) -> Frame:
        return Frame(**vars(self))


class Variable:
    """Array as xarray has it."""

    dims, ndim = ("time",), 1

    def __init__(self, values: Any, units: str, time: Any) -> None:
        self._values, self.attrs, self.indexes = np.asarray(values), {"units": units}, {"time": time}

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self._values


class NAType:
    """What pandas calls NA: no comparison with it is true or false."""

    def __float__(self) -> float:
        raise TypeError("float() argument must be a real number")


def without(mask: np.ndarray, index: Any) -> Frame:
    return Frame(Labelled(index[~mask]), x_d=X_D[~mask], x=X[~mask])


MISSING: Mapping[str, Any] = {
    "NaN": {"x_d": X_D, "x": GAPS},
    "masked": {"x_d": X_D, "x": np.ma.array(np.where(GONE, 999.0, X), mask=GONE)},
    "masked integers": {"x_d": X_D, "x": np.ma.array(np.where(GONE, 999, X), mask=GONE)},
    "None": {"x_d": X_D.tolist(), "x": [None if gone else x for gone, x in zip(GONE, X, strict=True)]},
    "NA": Frame(x_d=X_D, x=np.array([NAType() if gone else x for gone, x in zip(GONE, X, strict=True)], object)),
    "Decimal": {"x_d": [decimal.Decimal(repr(x)) for x in X_D.tolist()], "x": GAPS},
    "Arrow": pa.table({"x_d": X_D, "x": pa.array(GAPS, from_pandas=True)}),
    "Arrow's batch": pa.record_batch({"x_d": X_D, "x": pa.array(GAPS, from_pandas=True)}),
    "fields": np.array(list(zip(X_D, GAPS, strict=True)), [("x_d", "f8"), ("x", "f8")]),
    "lazy": Lazy(x_d=X_D, x=GAPS),
}


class Dataset:
    data_vars: Mapping[str, Any] = {}


TABLES: list[Table] = [Frame(), Dataset(), np.zeros(3, [("x_d", "f8")]), 3.0]  # type: ignore[list-item]


@pytest.mark.parametrize("how", MISSING)
def test_what_is_missing_is_missing(how: str) -> None:
    """However it is said, and never a position."""
    log = read_log(MISSING[how], T_s=1e-3, unit="mm")
    np.testing.assert_array_equal(np.isnan(log.x_meas), GONE)
    np.testing.assert_allclose(log.x_d, 1e-3 * X_D, rtol=1e-15)
    if how != "masked integers":
        np.testing.assert_allclose(log.x_meas[~GONE], 1e-3 * X[~GONE], rtol=1e-15)


def test_a_masked_command_is_refused() -> None:
    with pytest.raises(LogError, match=r"sample 1001 .*: column 'x_d' must be finite, got nan"):
        read_log({"x_d": np.ma.array(X_D, mask=GONE), "x": X}, T_s=1e-3)
    with pytest.raises(SignalError, match="x_d must be finite, got nan at sample 1000"):
        as_samples(np.ma.array(1e-3 * X_D, mask=GONE), "x_d")
    masked = as_measured(np.ma.array(1e-3 * X, mask=GONE), "x")
    np.testing.assert_array_equal(np.isnan(masked), GONE)


DAY = np.datetime64("2026-01-01T00:00:00", "ns")
ZONE = timezone(timedelta(hours=1))
INDEXES: Mapping[str, np.ndarray] = {
    "datetimes": DAY + 2 * np.arange(N).astype("m8[ms]"),
    "durations": 2 * np.arange(N).astype("m8[ms]"),
    "seconds": 2 * T,
    "with a zone": np.array([datetime(2026, 1, 1, tzinfo=ZONE) + timedelta(milliseconds=2 * k) for k in range(N)]),
}


@pytest.mark.parametrize("what", INDEXES)
def test_an_index_of_times_is_the_time(what: str) -> None:
    index = INDEXES[what]
    assert read_log(Frame(Labelled(index), x_d=X_D, x=X)).T_s == 2e-3
    with pytest.raises(LogError, match=r"T_s = 0\.001 s was given, but column 'index' has an interval of 0\.002 s"):
        read_log(Frame(Labelled(index), x_d=X_D, x=X), T_s=1e-3)
    assert read_log(without(GONE, index)).starts == (0, 1000)
    assert read_log(Frame(Labelled(index), t=T, x_d=X_D, x=X)).T_s == 1e-3


@pytest.mark.parametrize("step", [1, 3])
def test_gaps_in_the_labels_are_gaps(step: int) -> None:
    """As ``dropna`` leaves them: rows that were taken out are not closed up."""
    log = read_log(without(GONE, step * np.arange(N) + 7), T_s=1e-3)
    assert (log.T_s, log.starts, len(log.t)) == (1e-3, (0, 1000), N - 100)
    assert "100 samples are missing in 1 gap" in log.remarks[-1]
    few = (np.arange(N) >= 1000) & (np.arange(N) < 1007)
    log = read_log(without(few, step * np.arange(N) + 7), T_s=1e-3)
    in_place = read_log({"x_d": X_D, "x": np.where(few, math.nan, X)}, T_s=1e-3)
    np.testing.assert_allclose(log.x_d, in_place.x_d, atol=1e-6)
    np.testing.assert_array_equal(log.x_meas, in_place.x_meas)
    assert read_log(Frame(Labelled(np.arange(N) + 7), x_d=X_D, x=X), T_s=1e-3).starts == (0,)
    assert read_log(Frame(Labelled(np.r_[0:1500, 0:1500]), x_d=X_D, x=X), T_s=1e-3).starts == (0, 1500)
    assert read_log(Frame(Labelled(np.arange(N), name="time [ms]"), x_d=X_D, x=X)).T_s == 1e-3
    assert read_log(Frame(Labelled(np.arange(N).astype(str)), x_d=X_D, x=X), T_s=1e-3).starts == (0,)


def test_labels_of_samples() -> None:
    shifted = Labelled(X, Labelled(np.arange(N) + 20))
    message = "x_d and x.* must have the same index, got 0 and 20 at sample 0; align them"
    refused(message, {"x_d": Labelled(X_D, Labelled(np.arange(N))), "x": shifted}, T_s=1e-3)
    machine = hybridsep.load_machine("spring_mass_damper")
    predictor = hybridsep.HybridPredictor(machine.model, machine.predictor_settings)
    with pytest.raises(SignalError, match=message):
        hybridsep.backtest(predictor, Labelled(1e-3 * X_D, Labelled(np.arange(N))), shifted)
    kept = Labelled(1e-3 * X_D[~GONE], Labelled(np.flatnonzero(~GONE)))
    with pytest.raises(SignalError, match="the index of r must be even, it goes from 999 to 1100 at sample 1000; read"):
        hybridsep.cosimulate(predictor, machine.new_plant(), kept)
    slower = Labelled(1e-3 * X_D, Labelled(np.datetime64("2026-03-05") + 2 * np.arange(N).astype("m8[ms]")))
    with pytest.raises(ParameterError, match=r"the index of x_d is sampled every 0\.002 s, but the predictor has T_s"):
        predictor.predict(slower)
    for T_s, n in ((1.25e-3, 100), (2.5e-3, 100), (2.5e-3, 2)):
        rounded = Labelled(X_D[:n], Labelled(np.datetime64("2026-03-05") + (1e3 * T_s * np.arange(n)).astype("m8[ms]")))
        np.testing.assert_array_equal(as_samples(rounded, "x_d", T_s=T_s), X_D[:n])
    levels = Labelled(np.arange(N))
    levels.nlevels = 2  # type: ignore[attr-defined]
    refused(r"the index runs backwards; sort_index\(\)", Frame(np.arange(len(X))[::-1], x_d=X_D, x=X), T_s=1e-3)
    refused(r"several levels is not read; reset_index\(\) makes columns", Frame(levels, x_d=X_D, x=X), T_s=1e-3)


def test_quantities_and_attributes_state_units() -> None:
    pint = {name: SimpleNamespace(magnitude=values, units="millimeter") for name, values in (("x_d", X_D), ("x", X))}
    log = read_log(pint, T_s=1e-3)
    assert (log.file_unit, log.unit_stated) == ("mm", True)
    np.testing.assert_allclose(log.x_d, 1e-3 * X_D)
    astropy = {"x_d": SimpleNamespace(value=X_D, unit="mm"), "x": SimpleNamespace(value=1e3 * X, unit="um")}
    np.testing.assert_allclose(read_log(astropy, T_s=1e-3).x_meas, 1e-3 * X)
    xarray = {name: Variable(values, "mm", T) for name, values in (("x_d", X_D), ("x", GAPS))}
    of_xarray = read_log(xarray)
    assert (of_xarray.T_s, of_xarray.file_unit, int(np.isnan(of_xarray.x_meas).sum())) == (1e-3, "mm", 100)
    refused(r"unit='um' \(--unit um\) was given, but column 'x_d' states 'mm'", xarray, unit="um")
    fields = [pa.field(name, pa.float64(), metadata={"unit": "mm"}) for name in ("x_d", "x")]
    assert read_log(pa.table([X_D, X], schema=pa.schema(fields)), T_s=1e-3).file_unit == "mm"
    with pytest.raises(SignalError, match="x_d must be in m or rad, got 'millimeter'; convert it, or read_log does"):
        as_samples(pint["x_d"], "x_d")
    with pytest.raises(LogError, match="column 'x_d' must be numbers: a list of quantities; make one quantity of it"):
        read_log({"x_d": [SimpleNamespace(magnitude=1.0, units="mm")] * N, "x": X}, T_s=1e-3)


@pytest.mark.parametrize(
    "values", [["0.1"] * 5, [True] * 5, np.ones(5, np.bool_), np.ones(5) * 1j, None, [object()] * 5, {"x": [1.0]}]
)
def test_no_numbers(values: Any) -> None:
    with pytest.raises(SignalError, match=r"x_d must be (numbers, got|one column, got a table|one-dimensional)"):
        as_samples(values, "x_d")


@pytest.mark.parametrize("given", [None, X_D, [1.0, 2.0], 5, np.stack([X_D, X])])
def test_what_is_no_log(given: Any) -> None:
    refused("a log is a file, a mapping of columns or a table, got", given, T_s=1e-3)


OF_TOOLS = (
    "target_q_{} | actual_q_{} | target_qd_{} | actual_qd_{} @ 3; q_cmd[{}] | q_act[{}] @ 3; x_d[{}] | x[{}] @ 3; "
    "desired.positions[{}] | actual.positions[{}] | desired.velocities[{}] @ 3; set_point | process_value; "
    "/arm/state/reference/positions[{}] | /arm/state/feedback/positions[{}] @ 3; ref | fb | control; ctrl_pos|{} | "
    "enc_pos|{} | des_pos|{} @ 3; cmd | pos | action | observation; Axis_{}.Position | Axis_{}.ActualPosition | "
    "Axis_{}.Velocity | Axis_{}.ActualVelocity @ 3; /joint_commands/a{}/position | /joint_states/a{}/position @ a3; "
    "RPOS({}) | FPOS({}) | PE({}) @ 1; s noml X [mm] | s actual X [mm] | s diff X [mm] | v noml X [mm/min]; "
    "PCMD(X)[mm] | POSF(X)[mm] | VCMD(X)[rpm]; PL.CMD (mm) | PL.FB (mm) | PL.ERR (mm) | VL.CMD (rpm); A: PCTRL_S_SET | "
    "A: PCTRL_S_ACT | A: PCTRL_LAG_ERROR; A Axis Reference Position | A Axis Motor Position | A Axis Position Error; "
    "Cumulative command pulses[pulse] | Cumulative feedback pulses[pulse] | Droop pulses[pulse]; Position Demand Value "
    "[qc] | Position Actual Value [qc] | Velocity Demand Value [rpm]; Position demand value (0x6062) | Position actual "
    "value (0x6064) | Target position (0x607A); Position Command [cnt] | Position [cnt] | Position Error [cnt]; "
    "S-0-0047, Lage-Sollwert [mm] | S-0-0051, Lage-Istwert Geber 1 [mm] | S-0-0189, Schleppabstand [mm]; "
    "axis0.controller.input_pos | axis0.pos_estimate | axis0.vel_estimate; control_position | position | velocity; "
    "target | angle | voltage; theta_des | theta; J{}_cmd | J{}_fb @ J3; x_cmd_counts | x_fb_counts; target_position | "
    "current_position | current; log.x_d.Data | log.x.Data; Sollposition [unit] | Istposition [unit]; X_SollPos | "
    "X_IstPos; Lagesollwert Achse X | Lageistwert Achse X; Position command | Position actual | Position command "
    "velocity | Position actual velocity; q_des | q | current_setpoint | current_feedback; Y_cmd | Y_act | Y_estimate "
    "| Y_planned; Z_ref | Z_act | Z_nominal; reference_position | position | estimated_position; q_des({}) | q({}) @ "
    "1; q_des[{}] | q[{}] @ 1; x_d({}) | x({}) @ 1; q_d[{}] | q[{}] | dq[{}] @ 2; _RPX | _TPX | _TEX; TPOS | APOS | "
    "POSERR; RPOS(X) | FPOS(X) | APOS(X) | TPOS(X); DPOS AXIS(0) | MPOS AXIS(0) | FE AXIS(0); goal_position | "
    "present_position | present_velocity; SetPos | ActPos | TargetPos; RPOS | FPOS | DPOS | MPOS; action.pan.pos | "
    "observation.state.pan.pos; Sollwert_Weg | Istwert_Weg; Group1.Pos.SetpointPosition | Group1.Pos.CurrentPosition | "
    "Group1.Pos.FollowingError"
)
"""Commanded and measured position, then others, as controllers, drives and recorders call them; and the axis."""


@pytest.mark.parametrize("one", OF_TOOLS.split("; "))
def test_names_of_robots_and_controllers(one: str) -> None:
    names, axis = one.partition(" @ ")[0].split(" | "), one.partition(" @ ")[2] or None
    data = {name.format(j): (j + 1) * x for j in range(4) for name, x in zip(names, [X_D, X, X, X], strict=False)}
    n = 1e-3 * (int((axis or "3").strip("aJ")) + 1)
    for order in (list(data), list(data)[::-1]):
        log = read_log({name: data[name] for name in order}, T_s=1e-3, axis=axis, unit="mm")
        np.testing.assert_allclose((log.x_d, log.x_meas), (n * X_D, n * X), rtol=1e-15)
        assert tuple(log.columns.values()) == tuple(name.format((axis or "").strip("aJ")) for name in names[:2])


def test_ticks_need_no_unit_where_the_interval_is_given() -> None:
    for names in (("time_ticks",), ("cmd/t", "act/t")):
        assert read_log({**dict.fromkeys(names, 1e4 * np.arange(N)), "x_d": X_D, "x": X}, T_s=1e-3).T_s == 1e-3


def test_units_of_names() -> None:
    assert stated_unit("Position, mm") == ("Position", "mm")
    assert stated_unit("Position (mm) set") == ("Position set", "mm")
    assert [stated_unit(f"x ({unit})")[1] for unit in ("0.1um", "counts", "X", "V")] == ["0.1um", "counts", "", ""]
    assert stated_unit("t_milliseconds") == stated_unit("t [milliseconds]") == ("t", "milliseconds")
    for name in ("Boom Ms", "Room in", "q[0]", "q(1)", "x_m", "io[in].x_d", "y[m].pos", "Pos(s) set", "s (min) 1"):
        assert stated_unit(name) == (name, "")


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"name": "../x"}, r"name .* must be a letter, then .* got '\.\./x'"),
        ({"name": 5}, "must be a letter, then .* got 5"),
        ({"v_max": math.nan, "a_max": 1.0, "j_max": 10.0}, "v_max must be finite, got nan"),
        ({"v_max": 1.0}, "missing: a_max, j_max"),
        ({"speed": 1.0}, "got 'speed'"),
        ({"Np": 0.5}, "Np must be a whole number, got 0.5"),
    ],
)
def test_odd_arguments_are_refused_before_the_log_is_read(known: dict[str, Any], message: str) -> None:
    with pytest.raises(HybridSepError, match=message):
        hybridsep.fit(None, **known)  # type: ignore[arg-type]


def test_messages_name_pythons_arguments_too() -> None:
    refused(r"name it: --x NAME; in Python by columns=\{'x': NAME\}$", {"x_d": X_D, "goal": X}, T_s=1e-3)
    for names in (("current_cmd", "current_fb"), ("position control output", "position")):
        refused("'x_d', 'x' are missing", dict(zip(names, (X_D, X), strict=True)), T_s=1e-3)
    with pytest.raises(LogError, match=r"in Python by columns=\{'t': NAME\}, or T_s=SECONDS$"):
        hybridsep.fit({"x_d": X_D, "x": X})
