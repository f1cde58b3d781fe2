"""Flavours of FMUs, versions of FMI that they are written for, and templates of their files."""

from pathlib import Path
from string import Template

FLAVOURS = ("native", "python")  # the default first
FMI_VERSIONS = ("2", "3")  # FMI 2.0 and FMI 3.0; the default first

TEMPLATES = Path(__file__).parent / "templates"


def filled(template: str, **values: object) -> str:
    """Return a file of ``fmi/templates`` with ``$name`` replaced by values, which are HTML in HTML."""
    return Template((TEMPLATES / template).read_text(encoding="utf-8")).substitute(values)
