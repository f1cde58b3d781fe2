"""Rows for the tables of tools of fmi-standard.org and ssp-standard.org: their rules, and what hybridsep writes."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import pytest
from places import ROOT

from hybridsep.fmi.flavours import FMI_VERSIONS
from hybridsep.fmi.ssp import SSP_VERSIONS

FOLDER = ROOT / "integrations" / "listings"

KEYS = {
    "name": str,
    "license": ("commercial", "osi"),
    "url": str,
    "vendor": str,
    "vendorURL": str,
    "examplesURL": str,
    "description": str,
    "features": [],
    "platforms": ["macOS", "Linux", "Windows"],
    "interfaces": ["GUI", "CLI", "library"],
    "fmiVersions": ["1.0", "2.0", "3.0"],
    "fmuExport": ["CS", "ME", "SE"],
    "fmuImport": ["CS", "ME", "SE"],
    "layeredStandards": ["BUS", "XCP", "REF"],
}
"""Keys of an entry in their order, each with what its value is: text, one of a tuple, or a part of a list."""


@pytest.fixture(scope="module")
def row() -> ET.Element:
    return ET.fromstring((FOLDER / "ssp-standard.org.html").read_text(encoding="utf-8"))


def test_the_entry_for_fmi_standard_org() -> None:
    entry = json.loads((FOLDER / "fmi-standard.org.json").read_text(encoding="utf-8"))
    assert list(entry) == list(KEYS)
    for key, allowed in KEYS.items():
        if allowed is str:
            assert entry[key]
        elif isinstance(allowed, tuple):
            assert entry[key] in allowed
        else:
            assert isinstance(allowed, list)
            assert set(entry[key]) <= set(allowed)
    assert entry["fmiVersions"] == [f"{version}.0" for version in FMI_VERSIONS]
    assert not entry["description"].endswith(".")
    assert "http" not in entry["description"]


def test_the_row_for_ssp_standard_org(row: ET.Element) -> None:
    name, vendor, description, licence, reads, writes = row.findall("td")
    assert [cell[0].text for cell in (name, vendor)] == ["hybridsep", "the hybridsep authors"]
    assert len(description) == 0
    assert not str(description.text).endswith(".")
    assert (licence.text, reads.text) == ("osi", "no")
    assert writes.text == "/".join(f"{version}.0" for version in SSP_VERSIONS)
