"""Where an FMU that was fitted comes from: ``resourceMetaData.srmd``, as SSP's standard for traceability has it.

The file (Simulation Resource Meta Data, SSP Traceability 1.0) lies where that standard puts it in an FMU. Its keywords
are classified under a name of our own, since the standard leaves them to whoever writes one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree as ET

from ..base.version import __version__
from .content import author, generation_time
from .model_description import document

__all__ = ["CLASSIFICATION", "RESOURCE_DATA_FILE", "resource_data"]

RESOURCE_DATA_FILE = "extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd"

CLASSIFICATION = "hybridsep.fit"
"""Type of the classification whose entries describe a fit."""

_SRMD = "http://ssp-standard.org/SSPTraceability1/SimulationResourceMetaData"
_STC = "http://ssp-standard.org/SSPTraceability1/SSPTraceabilityCommon"


def resource_data(name: str, guid: str, origin: Mapping[str, Any]) -> bytes:
    """Return the document.

    Parameters
    ----------
    name : str
        Model identifier.
    guid : str
        The modelDescription's.
    origin : mapping
        What the FMU was made from, plain values; tables and lists in it become keywords with dots and numbers.
    """
    ET.register_namespace("srmd", _SRMD)
    ET.register_namespace("stc", _STC)
    attributes = {
        "version": "1.0.0",
        "name": f"{name}: origin",
        "description": "log, settings and figures of the fit that the FMU comes from; lengths in m, times in s",
        "author": author(),
        "generationTool": f"hybridsep {__version__}",
        "generationDateAndTime": generation_time(),
    }
    root = ET.Element(f"{{{_SRMD}}}SimulationResourceMetaData", attributes)
    entries = ET.SubElement(root, f"{{{_STC}}}Classification", type=CLASSIFICATION)
    for keyword, text in (("model.guid", guid), *_flat("", origin)):
        ET.SubElement(entries, f"{{{_STC}}}ClassificationEntry", keyword=keyword).text = text
    return document(root)


def _flat(prefix: str, value: Any) -> list[tuple[str, str]]:
    """Return keywords and texts of a value."""
    if isinstance(value, Mapping):
        inner = list(value.items())
    elif isinstance(value, list | tuple):
        inner = list(enumerate(value, start=1))
    else:
        return [(prefix, str(value).lower() if isinstance(value, bool) else str(value))]
    return [pair for key, one in inner for pair in _flat(f"{prefix}.{key}" if prefix else str(key), one)]
