"""The script for Simulink, which nothing here runs: its ports and wires beside the FMUs."""

import re

import pytest
from built_once import BuiltFmus
from places import ROOT

from hybridsep.cosim.fmu import read_description

SCRIPT = (ROOT / "examples" / "simulink_loop.m").read_text(encoding="utf-8")
PORTS = {
    (fmu, f"{kind}put"): re.findall(r"'(\w+)'", names)
    for fmu, kind, names in re.findall(r"^ports\.(\w+)\.(in|out)puts = \{(.*)\};$", SCRIPT, re.MULTILINE)
}
FMUS = ("ReferenceTrajectory", "HybridPredictor", "SepCompensator", "FeedDrive")


@pytest.mark.slow
@pytest.mark.parametrize("fmu", FMUS)
def test_ports_are_the_fmus_in_their_order(fmu: str, fmus: BuiltFmus) -> None:
    variables = read_description(fmus(fmu)).modelVariables
    for causality in ("input", "output"):
        assert PORTS[fmu, causality] == [v.name for v in variables if v.causality == causality]


@pytest.mark.slow
def test_wires_end_at_ports() -> None:
    text = SCRIPT.partition("wires = {")[2].partition("};")[0]
    wires = [line.strip().split(", ") for line in text.strip().splitlines()]
    assert len(wires) == 3
    for look_ahead, command in (("HybridPredictor", "x_d"), ("SepCompensator", "x_dm")):
        values = {"lookAhead": look_ahead, "command": command}
        for source, output, sink, entry in ([values.get(word, word.strip("'")) for word in wire] for wire in wires):
            assert output in PORTS[source, "output"]
            assert entry in PORTS[sink, "input"]
