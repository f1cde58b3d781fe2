"""Terminals of an FMI 3.0 FMU: ``terminalsAndIcons/terminalsAndIcons.xml``, by which a tool connects whole FMUs.

A terminal is a plug: members of the same name of two terminals of one kind belong together. ``reference`` carries the
commanded position ahead of the drive, ``drive`` the command of the drive and its measured position.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

from .model_description import document

__all__ = ["ICON_FILE", "TERMINALS", "TERMINALS_FILE", "terminals_and_icons"]

TERMINALS_FILE = "terminalsAndIcons/terminalsAndIcons.xml"
ICON_FILE = "terminalsAndIcons/icon.png"

TERMINALS: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "HybridPredictor": {"reference": {"command": "x_d_ahead"}, "drive": {"command": "x_d", "measured": "x_meas"}},
    "SepCompensator": {"reference": {"command": "x_d_ahead"}, "drive": {"command": "x_dm", "measured": "x_meas"}},
    "FeedDrive": {"drive": {"command": "x_d", "measured": "x_meas"}},
    "ReferenceTrajectory": {"reference": {"command": "r"}},
}
"""Model → terminal → member → variable."""

_DESCRIPTIONS = {
    "reference": "commanded position, a look-ahead early",
    "drive": "command of the drive and measured position",
}
_EXTENT = 100.0
"""Half the width and height of the icon, in the coordinates of the terminals' file."""


def terminals_and_icons(model: str) -> bytes:
    """Return the document of a model.

    Parameters
    ----------
    model : str
        ``HybridPredictor``, ``FeedDrive``, …
    """
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = ET.SubElement(root, "GraphicalRepresentation")
    corners = {"x1": -_EXTENT, "y1": -_EXTENT, "x2": _EXTENT, "y2": _EXTENT}
    extent = {name: repr(place) for name, place in corners.items()}
    ET.SubElement(picture, "CoordinateSystem", extent, suggestedScalingFactorTo_mm="0.1")
    ET.SubElement(picture, "Icon", extent)
    terminals = ET.SubElement(root, "Terminals")
    for name, members in TERMINALS[model].items():
        attributes = {"name": name, "matchingRule": "plug", "terminalKind": f"hybridsep.{name}"}
        terminal = ET.SubElement(terminals, "Terminal", attributes, description=_DESCRIPTIONS[name])
        for member, variable in members.items():
            attributes = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            ET.SubElement(terminal, "TerminalMemberVariable", attributes)
    return document(root)
