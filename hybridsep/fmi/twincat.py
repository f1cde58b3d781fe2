"""Configuration file by which Beckhoff's TE1420, Target for FMI, compiles the source FMUs of this project.

TE1420 puts an FMU's sources into a project of Visual Studio; what a tool's sources need there stands in an XML file
of the form of its ``CustomFMU.xml``, which it finds in its folder of program data.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

from ..base.output import written_whole
from ..base.version import __version__

__all__ = [
    "CONFIGURATION_FILE",
    "DEFINITIONS",
    "write_configuration",
]

CONFIGURATION_FILE = "CustomFMU_hybridsep.xml"
"""Beside the archives; another name than the template's, which lies where the file goes."""

DEFINITIONS = ("HSEP_NO_FILES", "HSEP_NO_STDIO")
"""Macros of the compilation: the runtime opens no files, and has printf in part only."""

_ALL = "all.c"


def write_configuration(out: Path, archives: Iterable[Path]) -> Path:
    """Write the configuration for some archives beside them; return its path.

    Parameters
    ----------
    out : Path
        Folder; exists.
    archives : iterable of Path
        Native FMUs. ``all.c`` includes all their other sources, which are excluded from the build one by one.
    """
    path = out / CONFIGURATION_FILE
    with written_whole(path) as file:
        file.write(_configuration(_included_sources(archives)))
    return path


def _included_sources(archives: Iterable[Path]) -> list[str]:
    names: set[str] = set()
    for archive in archives:
        with ZipFile(archive) as opened:
            names |= {name.removeprefix("sources/") for name in opened.namelist() if name.startswith("sources/")}
    return sorted(name for name in names if name.endswith(".c") and name != _ALL)


def _configuration(excluded: Iterable[str]) -> bytes:
    root = ElementTree.Element("CustomConfigurations")
    root.set("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance")
    root.set("xsi:noNamespaceSchemaLocation", "CustomFmu.xsd")
    tool = ElementTree.SubElement(root, "FmuConfiguration")
    for name, text in (
        ("ToolName", f"hybridsep {__version__}"),  # the generationTool of modelDescription.xml
        ("AdditionalInclude", "$(ProjectDir);$(ProjectDir)sources;"),
        ("PreprocessorDefinitions", ";".join(DEFINITIONS)),
        ("ExcludedFromBuild", ";".join(excluded)),
        ("CodeReplacements", ""),
    ):
        ElementTree.SubElement(tool, name).text = text
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return content
