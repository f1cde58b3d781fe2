"""``modelDescription.xml`` of an FMI 3.0 co-simulation FMU: a template, filled from machine and variable table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree as ET

from numpy.typing import ArrayLike

from ..base.version import __version__
from ..machines.machine import Machine
from .content import fmu_title, paper_note
from .experiment import stop_time
from .fmi3_variables import Fmi3Variable, fmi3_variables
from .model_description import add_items, document, template, unit_elements, variable_attributes, xml_text

__all__ = ["fmi3_description"]


def fmi3_description(
    machine: Machine,
    description: Mapping[str, Any],
    token: str,
    generation_tool: str,
    *,
    samples: ArrayLike | None = None,
) -> bytes:
    """Return the XML document of a native FMU, the same bytes for the same arguments.

    Parameters
    ----------
    machine : Machine
        Its sampling interval and trajectory make the default experiment.
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``; the name is also the model identifier.
    token : str
        The instantiation token, which follows from the content; see :mod:`hybridsep.fmi.content`.
    generation_tool : str
    samples : (n,) array_like, m, optional
        Trajectory that a ReferenceTrajectory was built with.
    """
    model, name, table = str(description["model"]), str(description["name"]), fmi3_variables(description)
    root = template("modelDescription3.xml")
    simulation, units, types, _, experiment, variables, structure = root
    root.attrib |= {
        "modelName": name,
        "instantiationToken": token,
        "description": fmu_title(machine, model) + paper_note(machine, model),
        "version": __version__,
        "generationTool": generation_tool,
    }
    simulation.set("modelIdentifier", name)
    used = {each.variable.unit for each in table}
    units.extend(unit for unit in unit_elements() if unit.get("name") in used)
    for variable in (each.variable for each in table if each.variable.items):
        attributes = {"name": variable.type_name, "description": variable.description}
        add_items(ET.SubElement(types, "EnumerationType", attributes), variable)
    if not len(types):
        root.remove(types)
    stop = stop_time(machine, description, samples)
    experiment.attrib |= {"stopTime": xml_text(stop), "stepSize": xml_text(machine.T_s)}
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
