"""Machine files that differ a little from others."""

from pathlib import Path

from hybridsep.machines.machine import machine_path


def changed_machine(path: Path, source: str | Path, *changes: tuple[str, str], more: str = "") -> Path:
    """Write a machine's file with parts of its text replaced and ``more`` after it; return its path."""
    text = machine_path(source).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text + more, encoding="utf-8")
    return path
