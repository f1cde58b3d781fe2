"""The notebook of ``examples``: run from the first cell to the last, it ends in a compensated loop."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from places import ROOT

from hybridsep.logs import formats

ROWS = 2001  # lines of the example log that are left: of the others the pages tell


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_log_becomes_a_compensated_loop_in_ten_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def shorter(path: Path) -> None:
        lines = gzip.decompress(formats.EXAMPLE.read_bytes()).splitlines(keepends=True)
        path.write_bytes(b"".join(lines[:ROWS]))

    monkeypatch.setattr(formats, "write_example", shorter)
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
