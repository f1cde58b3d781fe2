"""``modelDescription.xml`` of an FMI 3.0 co-simulation FMU: a template, filled from machine and variable table."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from .fmi3_variables import Fmi3Variable, fmi3_variables
from .fmu import Fmu
from .model_description import add_items, begun, document, types_of, variable_attributes, xml_text

__all__ = ["fmi3_description"]

_OWN_STEPS = ("FeedDrive",)
"""Models whose internal steps divide the communication step; all others sample at T_s."""


def fmi3_description(fmu: Fmu, token: str, generation_tool: str) -> bytes:
    """Return the XML document of a native FMU, the same bytes for the same arguments.

    Parameters
    ----------
    fmu : Fmu
        The machine's sampling interval and trajectory make the default experiment.
    token : str
        The instantiation token, which follows from the content; see :mod:`hybridsep.fmi.content`.
    generation_tool : str
    """
    table = fmi3_variables(fmu.table)
    own_table = [each.variable for each in table]
    named = {"instantiationToken": token}
    root = begun("modelDescription3.xml", fmu, own_table, named, generation_tool)
    simulation, _, types, _, _, variables, structure = root
    if fmu.table.model not in _OWN_STEPS:
        simulation.set("fixedInternalStepSize", xml_text(fmu.machine.T_s))
    for variable, attributes in types_of(own_table):
        # fmpy up to 0.3.23 reads no EnumerationType that has a description; the variable and the items have theirs
        del attributes["description"]
        add_items(ET.SubElement(types, "EnumerationType", attributes), variable)
    if not len(types):
        root.remove(types)
    for reference, each in enumerate(table):
        own, values = variable_attributes(each.variable, reference, integers=("Int32", "Enumeration"))
        element = ET.SubElement(variables, each.variable.kind, own | values)
        if each.size is not None:
            ET.SubElement(element, "Dimension", start=str(each.size))
    _fill_structure(structure, table)
    return document(root)


def _fill_structure(structure: ET.Element, table: Sequence[Fmi3Variable]) -> None:
    """Name the outputs, which have no direct feedthrough, and their dependencies at initialization."""
    reference = {each.variable.name: str(i) for i, each in enumerate(table)}
    outputs = [each.variable for each in table if each.variable.causality == "output"]
    for variable in outputs:
        ET.SubElement(structure, "Output", valueReference=reference[variable.name], dependencies="")
    for variable in outputs:
        dependencies = " ".join(reference[name] for name in variable.initially_from)
        attributes = {"valueReference": reference[variable.name], "dependencies": dependencies}
        ET.SubElement(structure, "InitialUnknown", attributes)
