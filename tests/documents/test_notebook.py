"""The notebook of ``examples``, run from the first cell to the last, and what a kernel shows of a figure."""

import base64
import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from places import ROOT
from quick_fits import with_short_references

from hybridsep.logs import formats

ROWS = 1601  # lines of the example log that are left: of the others the pages tell


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_log_becomes_a_compensated_loop_in_ten_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def shorter(path: Path) -> None:
        lines = gzip.decompress(formats.EXAMPLE.read_bytes()).splitlines(keepends=True)
        path.write_bytes(b"".join(lines[:ROWS]))

    monkeypatch.setattr(formats, "write_example", shorter)
    with_short_references(monkeypatch)
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((ROOT / "examples" / "log_to_loop.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) == 10
    names: dict[str, Any] = {}
    for cell in cells:
        exec(cell, names)  # what a reader runs
    off, hybrid = (names["runs"][how].tracking_rms for how in ("off", "hybrid"))
    assert hybrid < 0.05 * off
    assert (tmp_path / "report.html").is_file()
    assert (tmp_path / "my_axis" / "HybridPredictor_my_axis.fmu").is_file()


@pytest.mark.slow
def test_a_kernel_shows_a_figure_as_a_picture() -> None:
    run_kernel = pytest.importorskip("jupyter_client.manager").run_kernel
    shown: list[dict[str, Any]] = []
    cell = "from hybridsep.base.metrics import line_plot\nline_plot([0.0, 1.0], {'error': [0.0, 2.0]}, 't [s]', 'e')"
    with run_kernel(kernel_name="python3") as client:
        client.execute_interactive(cell, timeout=120, output_hook=lambda message: shown.append(message["content"]))
    (data,) = (one["data"] for one in shown if "data" in one)
    assert base64.b64decode(data["image/png"]).startswith(b"\x89PNG")
