"""Files of an FMU's ``extra/``: the manifest of its reference experiment (LS-REF) and where it comes from (SRMD).

The manifest names the files beside the model and what each is for, as FMI's layered standard fmi-ls-ref 1.0.0-beta.1
has it. The experiment is one of the Modelica Association's format of experiments (MA-HS-Experiments), to which
fmi-ls-ref leaves it: times, inputs and expected outputs. Both are written as their schemas are.

``resourceMetaData.srmd`` (Simulation Resource Meta Data, SSP Traceability 1.0) says from which log a fitted FMU is; its
keywords are classified under a name of our own, since the standard leaves them to whoever writes one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import PurePosixPath
from typing import Any
from xml.etree import ElementTree as ET

from ..base.version import __version__
from .description import document, xml_text
from .spec import AUTHOR, FmuSpec, generation_time

__all__ = [
    "AGREEMENT",
    "EXPERIMENT_FILE",
    "MANIFEST_FILE",
    "RELATED_FOLDER",
    "RESOURCE_DATA_FILE",
    "experiment",
    "manifest",
    "resource_data",
]

RELATED_FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST_FILE = f"{RELATED_FOLDER}/fmi-ls-manifest.xml"
EXPERIMENT_FILE = f"{RELATED_FOLDER}/reference.exp"

AGREEMENT: Mapping[str, int] = {"SepCompensator": 9}
"""Decimals, m, to which a model's reference agrees; else 11. The iteration for a bounded plan amplifies rounding."""

_LAYER = "http://fmi-standard.org/fmi-ls-manifest"
_NAMED = {
    "name": "org.fmi-standard.fmi-ls-ref",
    "version": "1.0.0-beta.1",
    "description": "Layered Standard providing information on related files included in an FMU.",
}
RESOURCE_DATA_FILE = "extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd"
_ELSEWHERE = {
    RESOURCE_DATA_FILE: ("application/x-srmd-meta-data", "meta-data", "log, settings and figures of the fit"),
}
"""Files of other folders, if they are there: type, role and description."""


def experiment(name: str, model: str, options: Mapping[str, float], *, inputs: bool) -> bytes:
    """Return the reference experiment.

    Parameters
    ----------
    name : str
        Model identifier; the tables are ``<name>_in.csv`` and ``<name>_ref.csv``.
    model : str
        ``HybridPredictor``, ``FeedDrive``, …
    options : mapping
        ``StartTime``, ``StopTime`` and ``StepSize``, s, and ``RelTol``.
    inputs : bool
        Whether it has any.
    """
    root = ET.Element("Experiments", name=name, description="reference run of the FMU with all its start values")
    digits = AGREEMENT.get(model, 11)
    attributes = {
        "name": "reference",
        "description": f"outputs agree within 1e-{digits:02} m where the communication step size is the stated one",
        "tolerance": xml_text(options["RelTol"]),
    }
    one = ET.SubElement(root, "Experiment", attributes)
    times = {f"{key[0].lower()}{key[1:]}": xml_text(options[key]) for key in ("StartTime", "StopTime", "StepSize")}
    ET.SubElement(one, "TransientSimulation", times)
    if inputs:
        ET.SubElement(one, "Stimuli", source=f"{name}_in.csv")
    ET.SubElement(one, "References", source=f"{name}_ref.csv")
    return document(root)


def manifest(files: Collection[str]) -> bytes:
    """Return the manifest of an FMU with files of these archive names."""
    ET.register_namespace("fmi-ls", _LAYER)
    root = ET.Element("fmiReferences", {f"{{{_LAYER}}}fmi-ls-{key}": text for key, text in _NAMED.items()})
    for file in sorted(files):
        place = PurePosixPath(file)
        if str(place.parent) == RELATED_FOLDER:
            _add(root, place.name, *_own(place.name))
        elif file in _ELSEWHERE:
            _add(root, f"../{place.parent.name}/{place.name}", *_ELSEWHERE[file])
    return document(root)


def _own(file: str) -> tuple[str, str, str]:
    """Return type, role and description of a file of the reference experiment."""
    if file.endswith(".exp"):
        return "application/x-ma-hs-experiments", "experiment/smoke-test", "reference experiment"
    if file.endswith("_ref.csv"):
        return "text/csv", "result", "outputs of the reference experiment"
    if file.endswith("_in.csv"):
        return "text/csv", "other", "inputs of the reference experiment"
    return "text/plain", "configuration", "times of the reference experiment, as FMI's cross-check had them"


def _add(root: ET.Element, source: str, kind: str, role: str, description: str) -> None:
    ET.SubElement(root, "Related", {"type": kind, "source": source, "role": role, "description": description})


_CLASSIFICATION = "hybridsep.fit"
"""Type of the classification whose entries describe a fit."""

_SRMD = "http://ssp-standard.org/SSPTraceability1/SimulationResourceMetaData"
_STC = "http://ssp-standard.org/SSPTraceability1/SSPTraceabilityCommon"


def resource_data(spec: FmuSpec, guid: str) -> bytes:
    """Return the document of an FMU with an origin, whose tables and lists become keywords with dots and numbers.

    Parameters
    ----------
    spec : FmuSpec
    guid : str
        The modelDescription's.
    """
    ET.register_namespace("srmd", _SRMD)
    ET.register_namespace("stc", _STC)
    attributes = {
        "version": "1.0.0",
        "name": f"{spec.table.name}: origin",
        "description": "log, settings and figures of the fit that the FMU comes from; lengths in m, times in s",
        "author": AUTHOR,
        "generationTool": f"hybridsep {__version__}",
        "generationDateAndTime": generation_time(),
    }
    root = ET.Element(f"{{{_SRMD}}}SimulationResourceMetaData", attributes)
    entries = ET.SubElement(root, f"{{{_STC}}}Classification", type=_CLASSIFICATION)
    for keyword, text in (("model.guid", guid), *_flat("", spec.origin)):
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
