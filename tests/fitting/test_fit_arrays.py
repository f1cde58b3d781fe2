"""``hybridsep.fit`` of arrays, a table and logs; what it returns."""

from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from command_line import write_rows
from quick_fits import without_larger_structures, without_other_settings
from staircase_data import commanded, measured

import hybridsep
from hybridsep.base.errors import LogError, ParameterError, SignalError, StateError
from hybridsep.fitting.result import Fit
from hybridsep.fmi.weights import restore_weights, weights_file

N, NP = 1200, 40
PART = np.r_[:600, 999:1599]  # moves in each half, between them at rest
X_D, X = commanded()[PART], measured(0)[PART]


@pytest.fixture(scope="module")
def axis() -> Fit:
    with pytest.MonkeyPatch.context() as patch:
        without_larger_structures(patch)
        without_other_settings(patch)
        return hybridsep.fit(1e3 * X_D, 1e3 * X, T_s=1e-3, unit="mm", Np=NP)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_arrays_a_table_and_a_file_are_one_log(axis: Fit, tmp_path: Path) -> None:
    time = np.datetime64("2026-03-05T10:00") + np.arange(N).astype("m8[ms]")
    table = pa.table({"time": time, "goal": 1e3 * X_D, "present": 1e3 * X})
    of_table = hybridsep.read_log(table, columns={"x_d": "goal", "x": "present"}, unit="mm")
    [of_arrays] = axis.logs
    of_file = hybridsep.read_log(write_rows(tmp_path / "axis.csv", 1e3 * X_D, 1e3 * X), unit="mm")
    for log in (of_table, of_arrays, of_file):
        assert (log.T_s, log.unit, log.shown) == (1e-3, "m", of_file.shown)
        np.testing.assert_allclose((log.x_d, log.x_meas), (X_D, X), rtol=0, atol=1e-12)
    again = hybridsep.fit([of_table], Np=NP).judged.replay.rms()
    assert again == pytest.approx(axis.judged.replay.rms(), rel=1e-6)


@pytest.mark.slow
def test_what_is_returned_predicts_compensates_and_shows_itself(axis: Fit, tmp_path: Path) -> None:
    rms_pb, _, rms_h = axis.judged.replay.rms()
    assert repr(
        axis
    ) == f"Fit(axis: Np = {NP}, positions in mm, hybrid {1e6 * rms_h:.3g} µm RMS, {axis.judged.replay.best().name} " + (
        f"{1e6 * axis.judged.replay.best().rms:.3g} µm)"
    )
    shown = unescape(axis._repr_html_())
    assert axis.advice in shown
    assert f"<td>physics model, RMS [µm]</td><td>{1e6 * rms_pb:.4g}</td>" in shown
    assert [line.get_label() for line in axis.plot().axes[0].get_lines()] == ["physics model", "hold", "hybrid"]
    assert axis.unit == "mm"  # as what it was given
    window, in_m = axis.predict(1e3 * X_D[:NP]), axis.predictor().predict(X_D[:NP])
    for name in ("x_h", "x_pb", "e_h", "x_h_std"):
        np.testing.assert_allclose(getattr(window, name), 1e3 * getattr(in_m, name), rtol=1e-12, atol=1e-12)
    of_metres = axis.predict(SimpleNamespace(magnitude=X_D[:NP], units="meter"))
    np.testing.assert_allclose(of_metres.x_h, window.x_h, rtol=1e-12)
    with pytest.raises(SignalError, match="positions must be in mm or a unit of its kind, got 'deg'"):
        axis.predict(SimpleNamespace(magnitude=X_D[:NP], units="deg"))
    [log] = axis.logs
    again = hybridsep.backtest(axis.predictor(), log)
    assert again.overall == hybridsep.backtest(axis.predictor(), log.x_d, log.x_meas).overall
    drive = hybridsep.load_machine("spring_mass_damper")
    plant, compensator = drive.new_plant(), axis.compensator()
    assert compensator.predictor.Np == axis.machine.compensator_predictor.Np != axis.predictor().Np
    as_in_fmus = axis.machine.new_predictor(axis.machine.compensator_predictor)
    restore_weights(as_in_fmus, weights_file(axis.predictor()))
    assert hybridsep.SepCompensator(as_in_fmus, compensator.settings).to_bytes() == compensator.to_bytes()
    with pytest.raises(
        StateError, match=r"must have this model and features: it has .*mode\[1\]\.zeta = 1\.0 instead of 0\.0499"
    ):
        drive.new_compensator(trained=axis.predictor())
    off, hybrid = (hybridsep.cosimulate(axis.compensator(how), plant, log).tracking_rms for how in ("off", "hybrid"))
    assert hybrid < 0.2 * off
    axis.report(tmp_path / "report.html")
    assert axis.advice in unescape((tmp_path / "report.html").read_text(encoding="utf-8"))


def test_what_cannot_be_is_refused(axis: Fit, tmp_path: Path) -> None:
    [log] = axis.logs
    assert axis == axis
    assert log != hybridsep.read_log({"x_d": X_D, "x": X}, T_s=1e-3)
    with pytest.raises(IsADirectoryError, match="report's path must be a file"):
        axis.report(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError, match="out must be a folder"):
        axis.build(tmp_path / "file")
    pieces = hybridsep.read_log({"t": 1e-3 * np.arange(N) + np.arange(N) // 30, "x_d": X_D, "x": X})
    with pytest.raises(ParameterError, match=r"has 30 samples; give a smaller Np, or 80 samples or more without"):
        hybridsep.fit(pieces, Np=NP, p=iter([8]))
    with pytest.raises(LogError, match=r"a log is a file, a mapping of columns or a table, got ndarray; x beside x_d"):
        hybridsep.fit(X_D, T_s=1e-3)
    with pytest.raises(LogError, match=r"arrays: column 'x' .* T_s \(--T_s\)|columns? 't'"):
        hybridsep.fit(X_D, X)
    with pytest.raises(ParameterError, match="T_s, unit must be left out where a Log is given"):
        hybridsep.fit(log, T_s=1e-3, unit="mm")
    with pytest.raises(LogError, match="all columns must have the same number of samples"):
        hybridsep.fit(X_D, X[1:], T_s=1e-3)
    slow = hybridsep.read_log({"x_d": X_D, "x": X}, T_s=2e-3)
    at_0 = hybridsep.LookAhead(axis.predictor(), 0)
    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: axis.predict(np.zeros(NP + 1)), "x_d must have at most Np = 40 samples, got 41"),
        (lambda: hybridsep.backtest(axis.predictor(), slow), r"the log is sampled every 0\.002 s, but the predictor"),
        (lambda: hybridsep.cosimulate(axis.predictor(), axis.machine.new_plant(), slow), "the log is sampled every"),
        (lambda: hybridsep.backtest(axis.predictor(), 1e3 * X_D, 1e3 * X), "x_d must be in m or rad: it moves"),
        (lambda: hybridsep.backtest(axis.predictor(), X_D, X, starts=(5,)), "starts must be whole numbers from 0 on"),
        (lambda: hybridsep.backtest(axis.predictor(), X_D, X, starts=(0.0, 0.5)), "starts must be whole numbers from"),
        (lambda: axis.report(None), "path must be a text or a path, got None"),  # type: ignore[arg-type]
        (lambda: axis.build("a", progress=None), "progress must be a function, got None"),  # type: ignore[arg-type]
        (lambda: at_0.sample(None, 0.0), "x_d_ahead must be a number, got None at sample 0"),  # type: ignore[arg-type]
    ]
    for call, message in calls:
        with pytest.raises((ParameterError, SignalError), match=message):
            call()
    rapid = 1e-3 * np.r_[20.0 * np.arange(100), 0.0]  # 20 m/s, then a jump; 4 m are not too many
    assert hybridsep.backtest(axis.predictor(), rapid, rapid, starts=[0.0, 50.0]).n_batches == 4
    at_0.sample(0.5, 0.0)
    assert at_0._ahead[0] == 0.5
    assert "rms_h_urad" in hybridsep.backtest(axis.predictor(), replace(log, unit="rad")).summary()
