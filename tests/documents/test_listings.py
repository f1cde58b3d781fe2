"""Rows for the tables of tools of fmi-standard.org and ssp-standard.org: their rules, and what hybridsep writes."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

from places import ROOT

from hybridsep.fmi.flavours import FMI_VERSIONS
from hybridsep.fmi.ssp import SSP_VERSIONS

FOLDER = ROOT / "integrations" / "listings"

KEYS = {
    **dict.fromkeys(("name", "url", "vendor", "vendorURL", "examplesURL", "description"), str),
    "license": {"commercial", "osi"},
    "features": set(),
    "platforms": {"macOS", "Linux", "Windows"},
    "interfaces": {"GUI", "CLI", "library"},
    "fmiVersions": {"1.0", "2.0", "3.0"},
    "fmuExport": {"CS", "ME", "SE"},
    "fmuImport": {"CS", "ME", "SE"},
    "layeredStandards": {"BUS", "XCP", "REF"},
}
"""Keys of an entry, each with what its value is: text, or a part of a set."""


def test_the_entry_for_fmi_standard_org() -> None:
    entry = json.loads((FOLDER / "fmi-standard.org.json").read_text(encoding="utf-8"))
    assert set(entry) == set(KEYS)
    for key, allowed in KEYS.items():
        if isinstance(allowed, set):
            assert {entry[key]} <= allowed if key == "license" else set(entry[key]) <= allowed
        else:
            assert entry[key]
    assert entry["fmiVersions"] == [f"{version}.0" for version in FMI_VERSIONS]


def test_the_row_for_ssp_standard_org() -> None:
    row = ET.fromstring((FOLDER / "ssp-standard.org.html").read_text(encoding="utf-8"))
    _, _, _, licence, reads, writes = row.findall("td")
    assert (licence.text, reads.text) == ("osi", "no")
    assert writes.text == "/".join(f"{version}.0" for version in SSP_VERSIONS)
