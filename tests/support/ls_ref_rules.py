"""Rules of FMI's layered standard LS-REF, and of the format of its experiments, as their schemas and texts have them.

fmi-ls-ref 1.0.0-beta.1 (``fmi3LayeredStandardReferenceManifest.xsd``) and MA-HS-Experiments
(``maHarmonizedSpecificationExperiments.xsd``): elements in their order, attributes that are required or allowed, and
what the text asks of names and roles. Labels are allowed, and not used.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree as ET

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
LAYER = "{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-"
ROLE = re.compile(
    "document|requirement|specification|model|parameter|system|testcase|result|method|rationale|report|request|delivery"
    "|configuration|signature|meta-data|other|serialized-state(/.*)?"
    "|experiment(/(smoke-test|validation|uncertainty-analysis))?"
)
ROOT = {
    f"{LAYER}name": "org.fmi-standard.fmi-ls-ref",
    f"{LAYER}version": "1.0.0-beta.1",
    f"{LAYER}description": "Layered Standard providing information on related files included in an FMU.",
}
RELATED = {"type", "source", "role", "description"}
EXPERIMENTS = "application/x-ma-hs-experiments"
TIMES = {"startTime", "stopTime", "stepSize"}


def findings(files: Mapping[str, bytes]) -> list[str]:
    """Return what is wrong with the related files of an FMU: archive name → content."""
    return list(_manifest(files))


def _manifest(files: Mapping[str, bytes]) -> Iterator[str]:
    root = ET.fromstring(files[f"{FOLDER}/fmi-ls-manifest.xml"])
    if root.tag != "fmiReferences" or root.attrib != ROOT:
        yield f"root: {root.tag} {root.attrib}"
    named = set()
    for one in root:
        source = one.get("source", "")
        path = posixpath.normpath(posixpath.join(FOLDER, source))
        named.add(path)
        if one.tag != "Related" or not {"source", "role"} <= set(one.attrib) <= RELATED or len(one):
            yield f"{one.tag} {sorted(one.attrib)}"
        if not ROLE.fullmatch(one.get("role", "")):
            yield f"role {one.get('role')!r}"
        if path not in files:
            yield f"{source} is not there"
            continue
        if one.get("type") == EXPERIMENTS:
            yield from _experiments(files, path)
        if (one.get("role") or "").startswith("experiment") != (one.get("type") == EXPERIMENTS):
            yield f"{source}: {one.get('role')} of type {one.get('type')}"
    own = {path for path in files if path.startswith(f"{FOLDER}/")} - {f"{FOLDER}/fmi-ls-manifest.xml"}
    yield from (f"{path} is not named" for path in sorted(own - named))


def _experiments(files: Mapping[str, bytes], path: str) -> Iterator[str]:
    if not path.endswith(".exp"):
        yield f"{path}: suffix"
    root = ET.fromstring(files[path])
    if root.tag != "Experiments" or not {"name"} <= set(root.attrib) <= {"name", "description"} or not len(root):
        yield f"{path}: {root.tag} {root.attrib}"
    for one in root:
        tags = [part.tag for part in one]
        expected = [tag for tag in ("TransientSimulation", "Parameters", "Stimuli", "References") if tag in tags]
        if one.tag != "Experiment" or tags != expected or "TransientSimulation" not in tags:
            yield f"{path}: {one.tag} {tags}"
        if not {"name"} <= set(one.attrib) <= {"name", "description", "tolerance"}:
            yield f"{path}: {sorted(one.attrib)}"
        for part in one:
            if part.tag == "TransientSimulation":
                if set(part.attrib) != TIMES or not all(float(text) >= 0.0 for text in part.attrib.values()):
                    yield f"{path}: {part.attrib}"
            elif set(part.attrib) - {"type"} != {"source"}:
                yield f"{path}: {part.tag} {part.attrib}"
            elif posixpath.normpath(posixpath.join(posixpath.dirname(path), part.get("source", ""))) not in files:
                yield f"{path}: {part.get('source')} is not there"
