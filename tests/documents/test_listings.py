"""Rows for the tables of tools of fmi-standard.org and ssp-standard.org: their rules, and what hybridsep writes."""

import json
from xml.etree import ElementTree as ET

from places import ROOT

from hybridsep.fmi.flavours import FMI_VERSIONS
from hybridsep.fmi.ssp import SSP_VERSIONS

FOLDER = ROOT / "integrations" / "listings"


def test_the_rows_name_the_versions_that_are_written() -> None:
    entry = json.loads((FOLDER / "fmi-standard.org.json").read_text(encoding="utf-8"))
    assert entry["fmiVersions"] == [f"{version}.0" for version in FMI_VERSIONS]
    row = ET.fromstring((FOLDER / "ssp-standard.org.html").read_text(encoding="utf-8"))
    *_, licence, reads, writes = (cell.text for cell in row.findall("td"))
    assert (entry["license"], licence, reads) == ("osi", "osi", "no")
    assert writes == "/".join(f"{version}.0" for version in SSP_VERSIONS)
