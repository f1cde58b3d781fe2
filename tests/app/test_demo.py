"""Demonstration: FMUs, figures, summary, and the results on the page of figures and in the README against them."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from places import EMPS, ROOT
from rich.console import Console

from hybridsep.app import tables
from hybridsep.app.overwrite import BY_ENDING
from hybridsep.demo.compensation import COMPENSATED
from hybridsep.demo.demo import demo, demo_files
from hybridsep.fmi.builds import default_flavour

PAGE = (ROOT / "docs" / "evidence" / "figures.md").read_text(encoding="utf-8")
PNG = b"\x89PNG\r\n\x1a\n"
CASES = ("staircase", "spiral_x", "spiral_y")
FLAVOUR = default_flavour()
"""As on the page of figures; the Python flavour takes ten times as long and comes to the same figures."""


@dataclass(frozen=True)
class Demonstration:
    out: Path
    summary: dict[str, dict[str, Any]]
    fractions: list[float]

    def compensation(self, case: str, figure: str) -> list[float]:
        return [self.summary[case]["compensation"][kind][figure] for kind in COMPENSATED]


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Demonstration:
    out = tmp_path_factory.mktemp("demo")
    fractions: list[float] = []
    emps = EMPS if EMPS.exists() else None
    summary = demo(out, flavour=FLAVOUR, emps=emps, progress=lambda message, fraction: fractions.append(fraction))
    return Demonstration(out, summary, fractions)


@pytest.mark.slow
def test_demo_writes_all_it_promises(shown: Demonstration) -> None:
    assert json.loads((shown.out / "summary.json").read_text()) == shown.summary
    assert set(shown.summary) - {"emps"} == set(CASES)
    for case in shown.summary.values():
        assert {"rms_pb_um", "rms_hold_um", "rms_h_um", "reduction_percent", "ratio_to_hold", "printed"} <= set(case)
        assert case["verdict"].startswith("Better than the physics model: ")
        assert case["rms_h_um"] < case["rms_pb_um"]
        assert 0 < len(case["batches_hybrid_worse"]) < case["n_batches"] / 4  # the paper's honest part
    figures = [*CASES, "spiral", "spiral_contour", *(f"{case}_compensated" for case in CASES)]
    for name in figures:
        assert (shown.out / f"{name}.png").read_bytes().startswith(PNG)
    for name in CASES:
        assert (shown.out / f"{name}_compensated.csv").read_text().startswith("t,x_d,x_dm,")
    written = {path for path in shown.out.rglob("*") if path.is_file()}
    assert written == set(demo_files(shown.out, FLAVOUR, emps=EMPS.exists()))
    assert all(BY_ENDING[path.suffix].recognises(path) for path in written)
    assert len(list((shown.out / "fmus").glob("*.fmu"))) == 9
    assert len(list((shown.out / "fmus" / "warm").glob("SepCompensator*.fmu"))) == 3
    assert shown.fractions == sorted(shown.fractions)
    assert shown.fractions[-1] == 1.0
    assert len(set(shown.fractions)) == len(shown.fractions)


@pytest.mark.slow
def test_staircase_error_reduction(shown: Demonstration) -> None:
    """Printed: physics 33.7 µm, hybrid 14.7 µm, reduction 56.4 %."""
    mean = shown.summary["staircase"]
    assert mean["n_seeds"] == 10
    assert 33.6 < mean["rms_pb_um"] < 34.3
    assert 14.5 < mean["rms_h_um"] < 15.2
    assert 55.0 < mean["reduction_percent"] < 58.0
    assert mean["rms_hold_um"] == pytest.approx(42.5, abs=0.6)
    # against the true position; without compensation the servo error is 88.5 µm
    assert mean["rms_pb_true_um"] == pytest.approx(33.55, abs=0.01)
    assert mean["rms_h_true_um"] == pytest.approx(14.0, abs=0.2)
    assert mean["servo_error_rms_um"] == pytest.approx(88.5, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "printed", "tolerance", "most"), [("x", 22.0, 0.1, 13.3), ("y", 130.2, 0.5, 98.5)])
def test_spiral_error_reduction(shown: Demonstration, axis: str, printed: float, tolerance: float, most: float) -> None:
    """Printed: X 22 → 13.7 µm, 38 %; Y 130.2 → 94.5 µm, 27 %; with Table 1 and friction scaled to the first figures."""
    both = shown.summary[f"spiral_{axis}"]
    assert both["rms_pb_um"] == pytest.approx(printed, abs=tolerance)
    assert 0.9 * most < both["rms_h_um"] <= most
    # What one cause alone leaves to learn: the cable's stiffness is smooth, the friction jumps.
    friction, stiffness = both["friction_alone"], both["stiffness_alone"]
    assert stiffness["reduction_percent"] > 70.0 > both["reduction_percent"] > friction["reduction_percent"] > 15.0


@pytest.mark.slow
def test_demo_compensates(shown: Demonstration) -> None:
    """Tracking RMS of the true position, µm: less from kind to kind."""
    for case in CASES:
        figures = shown.compensation(case, "tracking_rms_um")
        assert figures == sorted(figures, reverse=True)
    none, physics, cold, warm = shown.compensation("staircase", "tracking_rms_um")
    assert 87.0 < none < 90.0
    assert physics < 20.5
    assert cold < 5.0
    assert warm < 1.8
    x, y = (shown.compensation(case, "tracking_rms_um") for case in ("spiral_x", "spiral_y"))
    assert x[3] < 0.25 * x[1]
    assert y[3] < 0.6 * y[1]  # its physics model keeps the direction too
    contour = shown.compensation("spiral_x", "contour_rms_um")
    assert contour == shown.compensation("spiral_y", "contour_rms_um") == sorted(contour, reverse=True)
    assert max(shown.compensation("staircase", "peak_jerk_m_s3")) <= 5000 * (1 + 1e-9)


@pytest.mark.slow
@pytest.mark.skipif(not EMPS.exists(), reason="needs ../shared/data/emps beside the repository")
def test_demo_with_the_recorded_axis(shown: Demonstration) -> None:
    assert shown.summary["emps"]["rms_h_um"] <= 5.55
    assert (shown.out / "emps.png").read_bytes().startswith(PNG)


def row_of(label: str, page: str = PAGE) -> list[float]:
    """Return the figures of a page's only row that begins with a label."""
    (row,) = re.findall(rf"^\| {label}[^|]*\|(.*)\|$", page, re.MULTILINE)
    return [float(figure) for figure in re.findall(r"(?<=\| )[\d.]+(?= (?:% )?\|)", f"|{row}|")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "label"),
    [("staircase", "staircase, FMU"), ("spiral_x", "spiral, stage X"), ("spiral_y", "spiral, stage Y")],
)
def test_predictions_on_the_page(shown: Demonstration, case: str, label: str) -> None:
    keys = ("rms_pb_um", "rms_hold_um", "rms_h_um", "reduction_percent", "ratio_to_hold")
    assert row_of(label)[:5] == pytest.approx([shown.summary[case][key] for key in keys], abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "figure", "label"),
    [
        ("staircase", "tracking_rms_um", "staircase, compensated"),
        ("spiral_x", "tracking_rms_um", "spiral X, compensated"),
        ("spiral_y", "tracking_rms_um", "spiral Y, compensated"),
        ("spiral_x", "contour_rms_um", "spiral, contour error"),
    ],
)
def test_compensation_on_the_page(shown: Demonstration, case: str, figure: str, label: str) -> None:
    # What has been learned differs a little from one LAPACK to another.
    assert row_of(label) == pytest.approx(shown.compensation(case, figure), rel=0.02, abs=0.06)


@pytest.mark.slow
def test_compensation_in_the_readme(shown: Demonstration) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| compensation: `hybridsep demo --out demo` \|(.*)\|$", readme, re.MULTILINE)
    figures = [float(figure) for figure in re.findall(r"[\d.]+", row)]
    assert figures == pytest.approx(shown.compensation("staircase", "tracking_rms_um"), rel=0.02, abs=0.06)


@pytest.mark.slow
def test_build_fmu_is_a_front_of_the_command_line(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "build_fmu.py"), "--machine", str(ROOT / "models" / "als25010_x.toml")]
    subprocess.run([*command, "--flavour", "python", "--out", str(tmp_path)], check=True, stdout=subprocess.DEVNULL)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "FeedDrivePy_als25010_x.fmu",
        "HybridPredictorPy_als25010_x.fmu",
        "SepCompensatorPy_als25010_x.fmu",
    ]


@pytest.mark.slow
def test_the_tables_fit_into_80_columns(shown: Demonstration, monkeypatch: pytest.MonkeyPatch) -> None:
    narrow = Console(width=80, record=True, file=io.StringIO())
    monkeypatch.setattr(tables, "console", narrow)
    parts = {"friction_alone": shown.summary["spiral_y"], "stiffness_alone": shown.summary["spiral_y"]}
    tables.print_predictions({**shown.summary, "spiral_y": {**shown.summary["spiral_y"], **parts}})
    tables.print_compensation(shown.summary)
    text = narrow.export_text()
    assert "…" not in text
    assert "130.2→94.5, 27 %" in text
