"""Generated files of the repository against the declarations they come from."""

import re
from pathlib import Path

import pytest
from places import ROOT

from docs.messages import ERRORS, FINDINGS
from generate import generated
from hybridsep.base import errors


@pytest.mark.parametrize("path", generated(), ids=lambda path: path.name)
def test_generated_files_are_up_to_date(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == generated()[path], "python generate.py writes it anew"


def test_every_exception_and_finding_is_explained() -> None:
    classes = {
        name for name, value in vars(errors).items() if isinstance(value, type) and value.__module__ == errors.__name__
    }
    assert set(ERRORS) == classes
    for name, one in (*ERRORS.items(), *FINDINGS.items()):
        assert one.cause.endswith("."), name
        assert one.remedy.endswith("."), name


@pytest.mark.parametrize("words", [words for one in ERRORS.values() for words in one.printed])
def test_words_of_messages_are_still_printed(words: str) -> None:
    paths = (path for path in (ROOT / "hybridsep").rglob("*.py") if path.name != "messages.py")
    # With adjacent string literals joined
    assert any(words in re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8")) for path in paths)
