"""``hybridsep backtest`` and its report."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, predictor, write_log, write_rows
from staircase_data import commanded, measured

from hybridsep import HybridPredictor, load_machine, read_log
from hybridsep.base.files import data_folder
from hybridsep.evaluate.backtest import backtest

MACHINE = ("-m", "spring_mass_damper")


def test_gaps_and_jitter_are_noted(hybridsep: Run, tmp_path: Path) -> None:
    log, page = tmp_path / "log.csv", tmp_path / "page.html"
    t = np.arange(3000) * 1e-3 + np.random.default_rng(1).uniform(-2e-4, 2e-4, 3000)
    rows = np.column_stack((t, commanded()[:3000], measured(0)[:3000]))[np.r_[0:900, 960:3000]]
    np.savetxt(log, rows, delimiter=",", header="t,x_d,x", comments="", fmt="%.17g")
    status, out, err = hybridsep("backtest", log, *MACHINE, "--json", "--report", page)
    assert status == 0, err
    assert page.read_text(encoding="utf-8").partition("</table>")[2].count("As recorded.") == 1  # below the notes
    assert "note: 60 samples are missing in 1 gap, the longest of 0.061" in err
    assert "intervals differ from 0.0009998 s, by up to " in err
    assert json.loads(out)["n_samples"] == 2940
    assert json.loads(out)["n_batches"] == 9 + 21  # each segment has windows of its own
    assert json.loads(out)["judged"]["n_windows"] == 9 + 20 - 1  # whole ones, but the one after the gap
    assert "the whole log is the test" in page.read_text(encoding="utf-8")
    assert "The window after a gap is no test window" in page.read_text(encoding="utf-8")
    assert [finding["name"] for finding in json.loads(out)["findings"]] == ["rate"]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_figures(hybridsep: Run, tmp_path: Path, suffix: str) -> None:
    log, figure = write_log(tmp_path / "log.csv", n=1000), tmp_path / f"figure{suffix}"
    drawn = []
    for t_init in (0.0, 0.3, 0.0) if suffix == ".svg" else (0.0,):
        options = (*predictor(t_init=t_init), "--figure", figure, "--force")
        out = hybridsep.done("backtest", log, *MACHINE, *options)
        assert out.splitlines()[-1] == f"wrote {figure}"
        drawn.append(figure.read_bytes())
    assert all(one.startswith((b"\x89PNG\r", b"<?xml")) for one in drawn)
    if suffix == ".svg":
        assert drawn[0] == drawn[2] != drawn[1]
        assert b"<!-- linear hybrid model -->" in drawn[0]
        assert b"<!-- linear hybrid model, after the warm-up -->" in drawn[1]
    assert "--figure must end in .png or .pdf or .svg" in hybridsep("backtest", log, *MACHINE, "--figure", "a.jpg")[2]


@pytest.mark.slow
def test_saved_state_and_predictions(hybridsep: Run, tmp_path: Path) -> None:
    log, state, table = write_log(tmp_path / "log.csv"), tmp_path / "my.state", tmp_path / "my.csv"
    cold = json.loads(hybridsep("backtest", log, *MACHINE, "--save", state, "--save", table, "--json")[1])
    assert HybridPredictor.load(state).k == 2500
    predictions = np.genfromtxt(table, delimiter=",", names=True)
    machine = load_machine("spring_mass_damper")
    found = backtest(machine.new_predictor(), commanded()[:2500], measured(0)[:2500])
    np.testing.assert_allclose(predictions["x_h"], found.x_h, atol=1e-12)
    warm = json.loads(hybridsep("backtest", log, *MACHINE, "--weights", state, "--json")[1])
    assert warm["rms_h_um"] < 0.8 * cold["rms_h_um"]
    assert warm["rms_pb_um"] == pytest.approx(cold["rms_pb_um"], rel=1e-12)
    err = hybridsep.refused("backtest", log, *MACHINE, "--weights", state, *predictor(p=20))
    assert "my.state was not trained for machine spring_mass_damper: it has p = 50 instead of 20" in err


@pytest.mark.slow
def test_brackets_are_text(hybridsep: Run, tmp_path: Path) -> None:
    """Brackets of a name are no markup: not in titles and cells, not in notes and errors."""
    log = write_log(tmp_path / "x[b]axis[red].csv", n=1000)
    out = hybridsep.done("backtest", log, *MACHINE)
    assert "x[b]axis[red].csv: prediction error against" in " ".join(out.split())
    err = hybridsep.refused("backtest", log, *MACHINE, "--x", "[bold]")
    assert "x[b]axis[red].csv" in err
    assert "[bold]" in err


@pytest.mark.slow
def test_a_rotary_axis(hybridsep: Run, tmp_path: Path) -> None:
    text = (data_folder("models") / "emps.toml").read_text(encoding="utf-8").partition("[log]")[0]
    linear, rotary = tmp_path / "axis.toml", tmp_path / "table.toml"
    linear.write_text(text, encoding="utf-8")
    rotary.write_text(text.replace("T_s =", 'unit = "rad"\nT_s =', 1) + '[log]\nx = "angle"\n', encoding="utf-8")
    columns = np.degrees(commanded()[:2500]), np.degrees(measured(0)[:2500])
    log = write_rows(tmp_path / "log.csv", *columns, header="t,x_d [deg],angle [deg]")
    assert read_log(log, columns={"x": "angle"}).unit == "rad"
    expected = json.loads(hybridsep("backtest", write_log(tmp_path / "m.csv"), "-m", linear, "--json")[1])
    out = hybridsep.done("backtest", log, "-m", rotary, "--json")
    assert json.loads(out)["rms_h_urad"] == pytest.approx(expected["rms_h_um"], rel=1e-6)
    shown = hybridsep("backtest", log, "-m", rotary)[1]
    assert "RMS [mdeg]" in shown
    assert "rad" not in shown
    # Where nothing is stated, the positions are in the machine's unit.
    out = hybridsep.done("backtest", tmp_path / "m.csv", "-m", linear, "--set", "unit=rad", "--json")
    assert json.loads(out)["rms_h_urad"] == pytest.approx(expected["rms_h_um"], rel=1e-9)
    err = hybridsep.refused("backtest", log, "-m", linear, "--x", "angle")
    assert "log.csv is in rad, but machine emps has unit = 'm'; correct the machine file, or say" in err


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("report") / "my axis.csv")


@pytest.mark.slow
def test_the_page_has_the_figures_of_backtest(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    options = (log, *MACHINE, *predictor(Np=50))
    scores = json.loads(hybridsep("backtest", *options, "--json")[1])
    out = hybridsep.done("backtest", *options, "--report", page)
    assert f"wrote {page}" in out
    assert f"{scores['rms_h_um']:.4g}" in out
    assert " ".join(scores["verdict"].split()) in " ".join(out.split())
    text = page.read_text(encoding="utf-8")
    for name in ("rms_pb_um", "rms_hold_um", "rms_h_um"):
        assert f"<td>{scores[name]:.4g}</td>" in text
    assert "my axis.csv" in text
    assert "began without any knowledge" in text
    assert "Nothing: time axis, samples, signs" in text
    assert text.count('id="chart') == 3


@pytest.mark.slow
def test_what_a_controller_says_is_printed_and_written(hybridsep: Run, tmp_path: Path) -> None:
    n, page = 1000, tmp_path / "page.html"
    x_d, x = commanded()[:n], measured(0)[:n]
    rows = zip(x_d[5:], x_d[:-5], x[:-5], x_d[:-5] - x[:-5], strict=True)
    text = "".join(",".join(map(repr, map(float, row))) + "\n" for row in rows)
    log = tmp_path / "log.csv"
    log.write_text(f"DES_POS|1,CTRL_POS|1,ENC_POS|1,CTRL_DIFF|1\n{text}")
    replayed = ("backtest", log, *MACHINE, "--T_s", "0.001", "--unit", "m")
    assert json.loads(hybridsep(*replayed, "--json")[1])["controller"]["look_ahead"] == 5
    out = hybridsep.done(*replayed, "--report", page)
    for shown in (out, page.read_text(encoding="utf-8")):
        assert "What the controller says of itself" in shown
        assert "leads the command of the position loop (CTRL_POS) by 5 samples (5 ms)" in shown


@pytest.mark.slow
def test_a_warm_start_is_said(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    saved = tmp_path / "learned.state"
    hybridsep.done("backtest", log, *MACHINE, "--save", saved)
    warm = (*MACHINE, "--weights", saved, "--report")
    out = hybridsep.done("backtest", log, *warm, tmp_path / "page.html")
    known = "Nothing is tested: the saved predictor was trained with this log, and knows it"
    assert known in out
    assert known in (tmp_path / "page.html").read_text(encoding="utf-8")
    other = write_rows(tmp_path / "other.csv", commanded(), measured(1))
    out = hybridsep.done("backtest", other, *warm, tmp_path / "other.html")
    assert "Use the hybrid (the only one that began trained): its error is 0." in out
    assert "began with what an earlier run had learned" in (tmp_path / "other.html").read_text(encoding="utf-8")
