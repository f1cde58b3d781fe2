"""Generated files of the repository against the declarations they come from."""

from __future__ import annotations

from pathlib import Path

import pytest

from generate import README, SETTINGS_HEADER, generated, readme


@pytest.mark.parametrize("path", [SETTINGS_HEADER, README], ids=lambda path: path.name)
def test_generated_files_are_up_to_date(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == generated()[path], "python generate.py writes it anew"


def test_rows_of_the_interface_tables_are_written_anew() -> None:
    text = README.read_text(encoding="utf-8")
    row = next(line for line in text.splitlines(keepends=True) if line.startswith("| `preview` |"))
    changed = text.replace(row, "| `old` | parameter, fixed | Real | 0 | a parameter that is no more |\n" * 2)
    assert readme(changed) == text
