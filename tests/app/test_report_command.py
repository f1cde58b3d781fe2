"""``hybridsep report``: one page about a replay, with backtest's figures, charts for print, steps of an FMU."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from built_once import BuiltFmus
from command_line import Run, write_log, write_rows
from staircase_data import commanded, measured

MACHINE = ("-m", "spring_mass_damper")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("report") / "my axis.csv")


@pytest.mark.slow
def test_the_page_has_the_figures_of_backtest(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    page, charts = tmp_path / "page.html", tmp_path / "charts.pdf"
    options = (log, *MACHINE, "--Np", 50)
    scores = json.loads(hybridsep("backtest", *options, "--json")[1])
    status, out, err = hybridsep("report", *options, "--out", page, "--figure", charts)
    assert status == 0, err
    assert f"report: {page}" in out
    text = page.read_text(encoding="utf-8")
    for name in ("rms_pb_um", "rms_hold_um", "rms_h_um"):
        assert f"<td>{scores[name]:.4g}</td>" in text
    assert "my axis.csv" in text
    assert "began without any knowledge" in text
    assert "Nothing: time axis, samples, signs" in text
    assert text.count('<div id="chart') == 4
    assert charts.read_bytes().count(b"/Type /Page ") == 4
    # its own files are written again, others are not
    assert hybridsep("report", *options, "--out", page, "--figure", charts)[0] == 0
    charts.write_bytes(b"%PDF-1.4 mine")
    status, _, err = hybridsep("report", *options, "--out", page, "--figure", charts)
    assert status == 2
    assert "exists and is no figure of hybridsep" in " ".join(err.split())


@pytest.mark.slow
def test_a_page_about_60_000_samples_stays_below_2_mb(hybridsep: Run, tmp_path: Path) -> None:
    x_d = np.tile(commanded()[:6000], 10)
    x = np.tile(measured(0)[:6000], 10) + np.random.default_rng(0).normal(0.0, 2e-6, 60_000)
    log = write_rows(tmp_path / "long.csv", x_d, x)
    page, charts = tmp_path / "page.html", tmp_path / "charts.pdf"
    status, _, err = hybridsep("report", log, *MACHINE, "--out", page, "--figure", charts)
    assert status == 0, err
    assert "60000 samples" in page.read_text(encoding="utf-8")
    assert page.stat().st_size < 2_000_000
    assert charts.stat().st_size < 500_000


@pytest.mark.slow
def test_warm_start_and_step_times(hybridsep: Run, log: Path, fmus: BuiltFmus, tmp_path: Path) -> None:
    saved = tmp_path / "learned.state"
    assert hybridsep("backtest", log, *MACHINE, "--save", saved)[0] == 0
    status, out, err = hybridsep(
        *("report", log, *MACHINE, "--weights", saved, "--out", tmp_path / "page.html"),
        *("--fmu", fmus("HybridPredictor")),
    )
    assert status == 0, err
    assert out.startswith("Use the hybrid: its error is 0.")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "began with what an earlier run had learned" in text
    assert "a step of HybridPredictor.fmu took" in text


def test_findings_are_shown_and_faults_refused(hybridsep: Run, tmp_path: Path) -> None:
    log = write_rows(tmp_path / "axis.csv", commanded()[:1500], -measured(0)[:1500])
    page = tmp_path / "page.html"
    status, _, err = hybridsep("report", log, *MACHINE, "--out", page)
    assert status == 2
    assert "moves opposite to the command" in err
    assert not page.exists()
    status, _, err = hybridsep("report", log, *MACHINE, "--out", page, "--fix")
    assert status == 0, err
    text = page.read_text(encoding="utf-8")
    assert "moves opposite to the command" in text
    assert text.count('<div id="chart') == 5
    for option, name in (("--out", "page.pdf"), ("--figure", "charts.png")):
        status, _, err = hybridsep("report", log, *MACHINE, option, tmp_path / name)
        assert status == 2
        assert f"{option} must end in" in err
