"""The main job: FMUs, figures, summary."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hybridsep.demo import demo

ROOT = Path(__file__).resolve().parents[1]
EMPS = ROOT.parent / "shared" / "data" / "emps" / "DATA_EMPS.mat"
PNG = b"\x89PNG\r\n\x1a\n"


def test_demo_writes_all_it_promises(tmp_path: Path) -> None:
    fractions: list[float] = []
    summary = demo(tmp_path, seeds=1, backend="python", progress=lambda message, fraction: fractions.append(fraction))
    assert json.loads((tmp_path / "summary.json").read_text()) == summary
    assert set(summary) == {"staircase", "spiral_x", "spiral_y"}
    for case in summary.values():
        assert {"rms_pb_um", "rms_hold_um", "rms_h_um", "reduction_percent", "printed"} <= set(case)
        assert case["rms_h_um"] < case["rms_pb_um"]
        assert 0 < len(case["batches_hybrid_worse"]) < case["n_batches"] / 4  # the paper's honest part
    for name in ("staircase", "spiral_x", "spiral_y", "spiral"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(PNG)
    assert len(list((tmp_path / "fmus").glob("*.fmu"))) == 6
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


@pytest.mark.skipif(not EMPS.exists(), reason="needs ../shared/data/emps beside the repository")
def test_demo_with_the_recorded_axis(tmp_path: Path) -> None:
    summary = demo(tmp_path, seeds=1, backend="python", emps=EMPS)
    assert summary["emps"]["rms_h_um"] <= 5.55
    assert (tmp_path / "emps.png").read_bytes().startswith(PNG)


def test_build_fmu_is_a_front_of_the_command_line(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "build_fmu.py"), "--machine", str(ROOT / "models" / "als25010_x.toml")]
    subprocess.run([*command, "--backend", "python", "--out", str(tmp_path)], check=True, stdout=subprocess.DEVNULL)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "FeedDrivePy_als25010_x.fmu",
        "HybridPredictorPy_als25010_x.fmu",
    ]
