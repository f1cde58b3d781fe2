"""Demonstration: FMUs, figures, summary, and the results on the page of figures and in the README against them."""

import io
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from built_once import built_once
from places import ROOT
from quick_fits import with_short_references
from rich.console import Console

from benchmarks.pictures import RECORD, demonstrated
from hybridsep.app import console, start
from hybridsep.base.metrics import shown_figure
from hybridsep.cosim.compensated import COMPENSATED, RIVAL
from hybridsep.demo import cases
from hybridsep.demo.cases import demo, demo_files
from hybridsep.plants.trajectory import spiral

PAGE = (ROOT / "docs" / "evidence" / "figures.md").read_text(encoding="utf-8")
CASES = ("staircase", "spiral_x", "spiral_y")


@dataclass(frozen=True)
class Demonstration:
    out: Path
    summary: dict[str, dict[str, Any]]
    fractions: list[float]

    def compensation(self, case: str, figure: str) -> list[float]:
        return [self.summary[case]["compensation"][kind][figure] for kind in COMPENSATED]


def shown_once(folder: Path, *, full: bool) -> Demonstration:
    """Run the demonstration once a session for all workers."""

    def run(out: Path) -> None:
        fractions: list[float] = []
        with pytest.MonkeyPatch.context() as patch:
            with_short_references(patch)
            demo(out / "demo", full=full, progress=lambda _, done: fractions.append(done))
        (out / "fractions.json").write_text(json.dumps(fractions), encoding="utf-8")

    out = built_once(folder, run)
    summary = json.loads((out / "demo" / "summary.json").read_text(encoding="utf-8"))
    return Demonstration(out / "demo", summary, json.loads((out / "fractions.json").read_text(encoding="utf-8")))


@pytest.fixture(scope="session")
def shown(session_folder: Path) -> Demonstration:
    return shown_once(session_folder / "demo", full=False)


@pytest.fixture(scope="session")
def full(session_folder: Path) -> Demonstration:
    return shown_once(session_folder / "full demo", full=True)


def check_files(shown: Demonstration, figures: list[str], *, full: bool) -> None:
    for name in figures:
        assert (shown.out / f"{name}.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    written = {path for path in shown.out.rglob("*") if path.is_file()}
    assert written == set(demo_files(shown.out, full=full))
    assert shown.fractions == sorted(shown.fractions)
    assert shown.fractions[-1] == 1.0
    assert len(set(shown.fractions)) == len(shown.fractions)


def check_case(case: dict[str, Any]) -> None:
    assert {"rms_pb_um", "rms_hold_um", "rms_h_um", "reduction_percent", "ratio_to_hold", "printed"} <= set(case)
    assert case["verdict"].startswith("Better than the physics model: ")
    assert case["rms_h_um"] < case["rms_pb_um"]
    assert 0 < case["n_batches_worse_than_physics"] < case["n_batches"] / 4  # the paper's honest part


@pytest.mark.slow
def test_demo_writes_all_it_promises(shown: Demonstration) -> None:
    assert list(shown.summary) == ["staircase"]
    for case in shown.summary.values():
        check_case(case)
    check_files(shown, ["staircase", "staircase_compensated"], full=False)
    assert (shown.out / "staircase_compensated.csv").read_text().startswith("t,x_d,x_dm,")
    assert len(list((shown.out / "fmus").glob("*.fmu"))) == 3


@pytest.mark.slow
def test_the_index_page_leads_to_all_that_was_written(shown: Demonstration) -> None:
    """The product's table first, the paper's model's after it, called so."""
    page = (shown.out / "index.html").read_text(encoding="utf-8")
    linked = set(re.findall(r'(?:href|src)="([^":]+)"', page))
    written = {path.relative_to(shown.out).as_posix() for path in shown.out.rglob("*") if path.is_file()}
    assert linked == written - {"index.html"}
    titles = re.findall(r"<h2>(.*?)</h2>", page)
    assert titles[0].startswith("Compensation: ")
    assert titles[1].startswith("The paper&#x27;s model (averaging = false): ")
    figures = [f"<td>{shown_figure(figure)}</td>" for figure in shown.compensation("staircase", "tracking_rms_um")]
    assert "".join(figures) in page
    assert "<script" not in page
    assert "http" not in page


@pytest.mark.slow
def test_demo_compensates(shown: Demonstration) -> None:
    """Tracking RMS of the true position, µm: less from kind to kind."""
    none, physics, cold, warm = shown.compensation("staircase", "tracking_rms_um")
    assert 87.0 < none < 90.0
    assert 15.0 < physics < 20.5
    assert cold < 5.0
    assert warm < 1.8
    assert max(shown.compensation("staircase", "peak_jerk_m_s3")) <= 5000 * (1 + 1e-9)


@pytest.mark.slow
def test_the_pictures_of_the_pages_show_these_figures(shown: Demonstration) -> None:
    recorded = json.loads(RECORD.read_text(encoding="utf-8"))["staircase_compensated.png"]["figures"]
    assert demonstrated(shown.summary) == pytest.approx(recorded, rel=0.02), "python -m benchmarks.pictures"


@pytest.mark.slow
def test_the_spirals_case_draws_both_axes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first 0.3 s; all of it at night."""
    with_short_references(monkeypatch)
    monkeypatch.setattr(cases, "spiral", lambda: [axis[:200] for axis in spiral()])
    said: list[str] = []
    summary = cases.spiral_case(tmp_path, said.append)
    assert list(summary) == ["spiral_x", "spiral_y"]
    assert len(said) == len(set(said)) == 2 * (1 + 2 + 1 + len([*COMPENSATED, RIVAL]))
    for case in summary.values():
        assert case["stiffness_alone"]["rms_pb_um"] < case["rms_pb_um"]
        assert list(case["compensation"]) == [*COMPENSATED, RIVAL]
    contours = [[case["compensation"][kind]["contour_rms_um"] for kind in COMPENSATED] for case in summary.values()]
    assert contours[0] == contours[1]
    assert contours[0][1] < contours[0][0]
    written = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert written <= set(demo_files(tmp_path, full=True))
    drawn = {path.stem for path in written if path.suffix == ".png"}
    assert drawn == {"spiral_contour", *(f"spiral_{axis}{what}" for axis in "xy" for what in ("", "_compensated"))}


@pytest.mark.nightly
def test_a_full_demo_writes_all_it_promises(full: Demonstration) -> None:
    assert tuple(full.summary) == CASES
    for case in full.summary.values():
        check_case(case)
    check_files(full, [*CASES, "spiral_contour", *(f"{case}_compensated" for case in CASES)], full=True)
    assert len(list((full.out / "fmus").glob("*.fmu"))) == 9
    assert len(list((full.out / "fmus" / "warm").glob("SepCompensator*.fmu"))) == 3


@pytest.mark.nightly
def test_what_one_cause_alone_leaves_to_learn(full: Demonstration) -> None:
    """The cable's stiffness is smooth, the friction jumps; printed of both: X 38 %, Y 27 %."""
    for both in (full.summary["spiral_x"], full.summary["spiral_y"]):
        friction, stiffness = both["friction_alone"], both["stiffness_alone"]
        assert stiffness["reduction_percent"] > 70.0 > both["reduction_percent"] > friction["reduction_percent"] > 15.0


def row_of(label: str) -> list[float]:
    """Return the figures of the page's only row that begins with a label, each RMS followed by its largest error."""
    (row,) = re.findall(rf"^\| {label}[^|]*\|(.*)\|$", PAGE, re.MULTILINE)
    return [float(figure) for figure in re.findall(r"(?<=\| )[\d.]+(?= [|%(])|(?<= \()[\d.]+(?=\))", f"|{row}|")]


PREDICTED = (
    *(f"{size}_{name}_um" for name in ("pb", "hold", "h") for size in ("rms", "max")),
    *("reduction_percent", "ratio_to_hold"),
)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("case", "figure", "label"),
    [
        ("staircase", "", "staircase, FMU"),
        ("spiral_x", "", "spiral, stage X"),
        ("spiral_y", "", "spiral, stage Y"),
        ("staircase", "tracking_rms_um", "staircase, compensated"),
        ("spiral_x", "tracking_rms_um", "spiral X, compensated"),
        ("spiral_y", "tracking_rms_um", "spiral Y, compensated"),
        ("spiral_x", "contour_rms_um", "spiral, contour error"),
    ],
)
def test_figures_on_the_page(full: Demonstration, case: str, figure: str, label: str) -> None:
    if not figure:
        found = [full.summary[case][key] for key in PREDICTED]
        assert row_of(label)[: len(found)] == pytest.approx(found, rel=5e-3, abs=0.06)
        return
    sizes = [full.compensation(case, one) for one in (figure, figure.replace("rms", "max"))]
    assert all(found == sorted(found, reverse=True) for found in sizes)  # less from kind to kind
    # What has been learned differs a little from one LAPACK to another.
    found = [one for pair in zip(*sizes, strict=True) for one in pair]
    assert row_of(label) == pytest.approx(found, rel=0.02, abs=0.06)


@pytest.mark.slow
def test_build_fmu_is_a_front_of_the_command_line(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "build_fmu.py"), "FeedDrivePy_als25010_x", "--flavour", "python"]
    machine = ROOT / "models" / "als25010_x.toml"
    subprocess.run([*command, "--machine", machine, "--out", tmp_path], check=True, stdout=subprocess.DEVNULL)
    assert [path.name for path in tmp_path.iterdir()] == ["FeedDrivePy_als25010_x.fmu"]


@pytest.mark.slow
def test_the_tables_fit_into_80_columns(shown: Demonstration, monkeypatch: pytest.MonkeyPatch) -> None:
    narrow = Console(width=80, record=True, file=io.StringIO())
    monkeypatch.setattr(console, "console", narrow)
    case = shown.summary["staircase"]
    contours = {
        kind: {**figures, "contour_rms_um": 123.45, "contour_max_um": 1234.56}
        for kind, figures in case["compensation"].items()
    }
    axis = {**case, "friction_alone": case, "stiffness_alone": case, "compensation": contours}
    summary = {**shown.summary, "spiral_x": axis, "spiral_y": axis}
    start.print_figures(summary)
    text = narrow.export_text()
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80
    assert "130.2→94.5, 27 %" in text
