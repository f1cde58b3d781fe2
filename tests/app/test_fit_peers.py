"""``hybridsep fit`` beside models that need no hybrid: its advice and verdict; share, rate and unit in headlines."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from oracle import arx_by_definition, free_run_by_definition
from places import RECORDINGS
from plotly.offline import get_plotlyjs
from staircase_data import commanded, measured

from hybridsep import read_log
from hybridsep.base.signals import Array
from hybridsep.fitting.advice import extent
from hybridsep.logs.units import shown_in, shown_of

NP = 20


def arx_rms(x_d: Array, x: Array, n: int) -> float:
    """Return the RMS of an ARX of ``n`` lags, fitted again before each test window."""
    first = -(-round(0.5 * len(x)) // NP) * NP
    errors = [
        x[k : k + NP] - free_run_by_definition(arx_by_definition(x_d, x, n, k), x_d, x, n, k, min(k + NP, len(x)))
        for k in range(first, len(x), NP)
    ]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_the_hybrid_is_not_recommended_where_an_arx_is_better(hybridsep: Run, tmp_path: Path) -> None:
    log = RECORDINGS / "cnc_a_axis2.npz"
    used = read_log(log)
    out = hybridsep.done("fit", log, "--out", tmp_path / "fit", "--Np", NP)
    judged = json.loads((tmp_path / "fit" / "fit.json").read_text())["judged"]
    arx = arx_rms(used.x_d, used.x_meas, 20)
    assert judged["rms_h"] > 1.02 * arx
    assert "Use the hybrid" not in out
    assert judged["peers"]["ARX20 (refitted)"] == pytest.approx(arx, rel=1e-6)
    assert judged["best"].startswith("ARX")
    words = " ".join(out.split())
    assert f"Best on what this log shows is {judged['best']}: the hybrid has {judged['ratio']:.2f} × its error" in words
    assert judged["ratio"] > 1.02
    # Table, verdict and advice are of the same samples
    assert f"Worse than {judged['best']}: {judged['ratio']:.3g} × its RMS error" in words
    figures = [judged["rms_pb"], judged["rms_hold"], *judged["peers"].values()]
    best = min(figure for figure in figures if not isinstance(figure, str))
    assert judged["ratio"] == pytest.approx(judged["rms_h"] / best, rel=1e-12)
    page = unescape((tmp_path / "fit" / "report.html").read_text(encoding="utf-8"))
    assert f"Best on what this log shows is {judged['best']}" in page
    for peer in judged["peers"]:
        assert f"<td>{peer}</td>" in page


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_the_physics_model_is_judged_with_its_offset(hybridsep: Run, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    x_d = commanded()[:800]
    log = write_rows(tmp_path / "axis.csv", x_d, x_d + 40e-6 + 1e-6 * rng.normal(size=800))
    hybridsep.done("fit", log, "--out", tmp_path / "fit", "--Np", 40)
    found = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert found["judged"]["rms_pb"] < 2e-6
    assert found["identification"]["offset"] == pytest.approx(40e-6, rel=0.05)
    assert "judged with the offset" in (tmp_path / "fit" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_headline_says_share_rate_and_the_logs_own_unit(hybridsep: Run, tmp_path: Path) -> None:
    """1 kHz, its sensor renewed every 2 ms, in degrees."""
    x = 3000 * measured(0)[:1600]
    x[1::2] = x[::2]
    log = write_rows(tmp_path / "axis.csv", 3000 * commanded()[:1600], x, header="t,x_d [deg],x [deg]")
    out = hybridsep.done("fit", log, "--out", tmp_path / "fit", "--Np", 40)
    words = " ".join(out.split())
    head = "800 of 1600 samples (50 %), 1.6 s at 500 Hz (recorded at 1000 Hz)"
    assert f"axis.csv: {head}, travel 60 deg" in words
    assert "Np = 40 (80 ms)" in words
    assert "RMS [mdeg]" in words
    written = (tmp_path / "fit" / "report.html").read_text(encoding="utf-8")
    page = unescape(written.replace(get_plotlyjs(), ""))
    assert head in page.partition("<h2>")[0]
    assert not re.search(r"\b[µm]?rad\b", words.partition("Next, to paste:")[0])  # options are in rad
    assert not re.search(r"\[[µm]?rad\]", page)
    assert "command [deg]" in page
    judged = json.loads((tmp_path / "fit" / "fit.json").read_text())["judged"]
    assert judged["rms_h"] < 3e-3  # rad
    assert f"{np.degrees(1e3 * judged['rms_h']):.4g}" in words
    tried = hybridsep.done("cosim", "-m", tmp_path / "fit" / "machine.toml")
    assert re.search(r"error\s+in\s+m?deg", tried)
    assert "x_d [deg]" in (tmp_path / "fit" / "commands.csv").read_text()


def test_missing_measurements_are_not_used_of_a_log(tmp_path: Path) -> None:
    x = measured(0)[:1600].copy()
    x[:400] = np.nan
    log = read_log(write_rows(tmp_path / "axis.csv", commanded()[:1600], x))
    assert extent([log]) == "1200 of 1600 samples (75 %), 1.6 s at 1000 Hz"


@pytest.mark.parametrize(
    ("unit", "position", "small", "large"),
    [
        ("m", "2000 mm", "2 µm", "20 mm"),
        ("mm", "2000 mm", "2 µm", "20 mm"),
        ("0.1 um", "2000 mm", "2 µm", "20 mm"),
        ("in", "78.74 in", "78.74 µin", "0.7874 in"),
        ("rad", "2000 mrad", "2 µrad", "20 mrad"),
        ("deg", "114.6 deg", "0.1146 mdeg", "1.146 deg"),
        ("rev", "0.3183 rev", "0.0003183 mrev", "3.183 mrev"),
    ],
)
def test_positions_and_errors_are_shown_in_the_family_of_the_files_unit(
    unit: str, position: str, small: str, large: str
) -> None:
    shown = shown_in(unit)
    for value, (factor, name), words in (
        (2.0, shown.position, position),
        (2e-6, shown.error(2e-6), small),
        (0.02, shown.error(0.02), large),
    ):
        assert f"{factor * value:.4g} {name}" == words


def test_a_unit_of_the_other_kind_is_not_shown() -> None:
    assert shown_of("deg", "rad") == shown_in("deg")
    assert shown_of("m", "rad") == shown_of("", "rad") == shown_in("rad")
