"""``hybridsep backtest --report``: one page about a replay."""

import json
from pathlib import Path

import pytest
from command_line import Run, predictor, write_log, write_rows
from staircase_data import commanded, measured

MACHINE = ("-m", "spring_mass_damper")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("report") / "my axis.csv")


@pytest.mark.slow
def test_the_page_has_the_figures_of_backtest(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    options = (log, *MACHINE, *predictor(Np=50))
    scores = json.loads(hybridsep("backtest", *options, "--json")[1])
    status, out, err = hybridsep("backtest", *options, "--report", page)
    assert status == 0, err
    assert f"wrote {page}" in out
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
    status, out, err = hybridsep(*replayed, "--report", page)
    assert status == 0, err
    for shown in (out, page.read_text(encoding="utf-8")):
        assert "What the controller says of itself" in shown
        assert "leads the command of the position loop (CTRL_POS) by 5 samples (5 ms)" in shown


@pytest.mark.slow
def test_a_warm_start_is_said(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    saved = tmp_path / "learned.state"
    assert hybridsep("backtest", log, *MACHINE, "--save", saved)[0] == 0
    warm = (*MACHINE, "--weights", saved, "--report")
    status, out, err = hybridsep("backtest", log, *warm, tmp_path / "page.html")
    assert status == 0, err
    known = "Nothing is tested: the saved predictor was trained with this log, and knows it"
    assert known in out
    assert known in (tmp_path / "page.html").read_text(encoding="utf-8")
    other = write_rows(tmp_path / "other.csv", commanded(), measured(1))
    status, out, err = hybridsep("backtest", other, *warm, tmp_path / "other.html")
    assert status == 0, err
    assert "Use the hybrid: its error is 0." in out
    assert "began with what an earlier run had learned" in (tmp_path / "other.html").read_text(encoding="utf-8")
