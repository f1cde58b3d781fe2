"""Settings header of the C core against the declarations."""

from __future__ import annotations

from hybridsep.fmi.settings_header import settings_header, settings_header_path


def test_the_settings_of_the_c_core_are_those_declared() -> None:
    written = settings_header_path().read_text(encoding="utf-8")
    assert written == settings_header(), "python -m hybridsep.fmi.settings_header writes it anew"
