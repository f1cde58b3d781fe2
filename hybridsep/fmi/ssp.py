"""Documents of a system: ``SystemStructure.ssd`` and parameter sets, SSP 1.0 or 2.0, which has FMI 3.0's types.

Enumerations are in neither: libcosim ends the process where it meets one. The FMUs' own start values hold for them.
There is no geometry, which is optional: tools place components themselves, and OMSimulator refuses one of a system.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from numpy.typing import ArrayLike

from ..base.errors import FmuError
from ..base.files import write_whole
from ..base.signals import as_samples
from ..base.version import __version__
from ..machines.machine import Machine
from . import native
from .archive import archived
from .description import described_variables, document, unit_elements
from .flavours import FMI_VERSIONS
from .spec import FmuSpec
from .variables import Variable
from .weights import saved_weights

SSP_VERSIONS = ("1", "2")  # SSP 1.0 with FMI 2.0 FMUs, SSP 2.0 with FMI 3.0 FMUs; the default first

_REALS = ("Real", "Float64")

_NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}


@dataclass(frozen=True)
class _Component:
    name: str
    fmu: str  # file below ``resources/``, as the parameter set
    parameter_set: str
    variables: tuple[Variable, ...]  # its table; the inputs and outputs become connectors, parameters its parameter set

    @property
    def connectors(self) -> list[Variable]:
        """Inputs and outputs, but enumerations, and inputs that nothing in the system tells."""
        return [v for v in self.variables if v.causality in ("input", "output") and not v.items and v.wired]

    @property
    def parameters(self) -> list[Variable]:
        """Parameters, but enumerations."""
        return [v for v in self.variables if v.causality == "parameter" and not v.items]


def _structure(
    name: str,
    components: Sequence[_Component],
    connections: Sequence[tuple[str, str, str, str]],
    T_s: float,
    stop_time: float,
    ssp: str,
) -> bytes:
    """Return ``SystemStructure.ssd``; connections are of component and output to component and input."""
    # OMSimulator needs annotations of the system, with the communication step size, and of the default experiment
    root = _root("ssd", "SystemStructureDescription", name, ssp)
    root.set("generationTool", f"hybridsep {__version__}")
    system = _add(root, "ssd:System", name=name)
    elements, wires = _add(system, "ssd:Elements"), _add(system, "ssd:Connections")
    for component in components:
        attributes = {"type": "application/x-fmu-sharedlibrary", "source": f"resources/{component.fmu}"}
        element = _add(elements, "ssd:Component", name=component.name, **attributes, implementation="CoSimulation")
        connectors = _add(element, "ssd:Connectors")
        for variable in component.connectors:
            connector = _add(connectors, "ssd:Connector", name=variable.name, kind=variable.causality)
            _add(connector, f"ssc:{variable.kind}", **_unit(variable))
        binding = {"type": "application/x-ssp-parameter-set", "source": f"resources/{component.parameter_set}"}
        _add(_add(element, "ssd:ParameterBindings"), "ssd:ParameterBinding", **binding)
    for connection in connections:
        places = zip(("startElement", "startConnector", "endElement", "endConnector"), connection, strict=True)
        _add(wires, "ssd:Connection", **dict(places))
    master = {"description": "oms-ma", "stepSize": T_s, "absoluteTolerance": 1e-4, "relativeTolerance": 1e-4}
    _add(_omsimulator(system), "oms:FixedStepMaster", **master)
    _add_units(_add(root, "ssd:Units"), [variable for component in components for variable in component.connectors])
    experiment = _add(root, "ssd:DefaultExperiment", startTime=0.0, stopTime=stop_time)
    _omsimulator(experiment, resultFile=f"{name}_res.mat", loggingInterval=0.0, bufferSize=10, signalFilter=".*")
    return _document(root)


def _parameter_set(component: _Component, ssp: str) -> bytes:
    """Return the ``.ssv`` with a component's parameters and their start values."""
    root = _root("ssv", "ParameterSet", component.name, ssp)
    parameters = _add(root, "ssv:Parameters")
    for variable in component.parameters:
        start = float(variable.start or 0.0) if variable.kind in _REALS else variable.start
        unit = _unit(variable) if variable.kind in _REALS else {}
        _add(_add(parameters, "ssv:Parameter", name=variable.name), f"ssv:{variable.kind}", value=start, **unit)
    _add_units(_add(root, "ssv:Units"), component.parameters)
    return _document(root)


def _root(prefix: str, tag: str, name: str, ssp: str) -> ET.Element:
    for namespace, uri in _NAMESPACES.items():
        ET.register_namespace(namespace, uri)
    return ET.Element(_tag(f"{prefix}:{tag}"), version=f"{ssp}.0", name=name)


def _omsimulator(parent: ET.Element, **attributes: object) -> ET.Element:
    """Add OMSimulator's annotation; return its information."""
    annotation = _add(_add(parent, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    return _add(_add(annotation, "oms:Annotations"), "oms:SimulationInformation", **attributes)


def _tag(name: str) -> str:
    prefix, _, local = name.partition(":")
    return f"{{{_NAMESPACES[prefix]}}}{local}"


def _add(parent: ET.Element, name: str, /, **attributes: object) -> ET.Element:
    texts = {key: str(value).lower() if isinstance(value, bool) else str(value) for key, value in attributes.items()}
    return ET.SubElement(parent, _tag(name), texts)


def _document(root: ET.Element) -> bytes:
    for child in [child for child in root if not len(child) and not child.attrib]:
        root.remove(child)
    return document(root)


def _unit(variable: Variable) -> dict[str, str]:
    return {} if variable.unit in (None, "1") else {"unit": str(variable.unit)}


def _add_units(parent: ET.Element, variables: Iterable[Variable]) -> None:
    used = {variable.unit for variable in variables}
    for unit in unit_elements():
        if unit.get("name") in used:
            attributes: dict[str, Any] = dict(unit[0].attrib)
            _add(_add(parent, "ssc:Unit", name=unit.get("name")), "ssc:BaseUnit", **attributes)


def check_system(machine: Machine, *, compensate: str | None, ssp: str = SSP_VERSIONS[0]) -> None:
    """Raise FmuError for an unknown version of SSP, MachineError without a plant or, to compensate, drive limits."""
    if ssp not in SSP_VERSIONS:
        raise FmuError(f"the version of SSP must be one of {', '.join(SSP_VERSIONS)}, got {ssp!r}")
    machine.check_section("plant")
    if compensate is not None:
        machine.check_section("drive_limits")


def build_system(
    machine: Machine,
    path: str | Path,
    command: ArrayLike,
    *,
    compensate: str | None = None,
    targets: Sequence[str] | None = None,
    weights: str | Path | None = None,
    ssp: str = SSP_VERSIONS[0],
    progress: Callable[[str, float], object] = lambda _message, _fraction: None,
) -> Path:
    """Write a system of three native FMUs as an SSP archive.

    ``machine``: with a plant; ``path``: the archive; ``command``, (n,), m: commanded positions at the machine's
    ``T_s``, which the system's ReferenceTrajectory plays; all FMUs start at the first of them; ``compensate``:
    {"off", "physics", "hybrid"}: best model with which a SepCompensator modifies the command; if left out a
    HybridPredictor only predicts; ``targets``, ``weights``: as in :func:`hybridsep.fmi.archive.build_fmu`, for the
    look-ahead; ``ssp``: {"1", "2"}: version of SSP: 1.0 with FMI 2.0 FMUs, 2.0 with FMI 3.0 FMUs; ``progress``:
    called with a message and the fraction done. MachineError without a plant or drive limits; FmuError if a library
    cannot be had, or there is no such version of SSP; SignalError if ``command`` is not finite or empty; StateError
    if ``weights`` is no saved predictor, or one of another machine or other settings.
    """
    check_system(machine, compensate=compensate, ssp=ssp)
    fmi = FMI_VERSIONS[SSP_VERSIONS.index(ssp)]
    samples = as_samples(command, "command")
    model, look_ahead, sent = (
        ("HybridPredictor", "predictor", "x_d") if compensate is None else ("SepCompensator", "compensator", "x_dm")
    )
    if compensate is not None:
        machine = machine.changed("compensator", {"compensate": compensate})
    parts = {"reference": "ReferenceTrajectory", look_ahead: model, "drive": "FeedDrive"}
    content: dict[str, bytes] = {}
    components: list[_Component] = []
    for i, (part, kind) in enumerate(parts.items()):
        progress(kind, i / len(parts))
        learned = saved_weights(weights, machine, kind) if part == look_ahead else None
        played = samples if part == "reference" else None
        # windows are no connectors, and thousands of errors of one importer's
        rest = float(samples[0])
        spec = FmuSpec.of(machine, kind, fmi=fmi, samples=played, weights=learned, windows=False, rest=rest)
        name = spec.table.name
        content[f"resources/{name}.fmu"] = archived(native.files(spec, targets=targets))
        scalars = [variable for variable, size in described_variables(spec.table, spec.fmi) if size is None]
        components.append(_Component(part, f"{name}.fmu", f"{machine.name}_{part}.ssv", tuple(scalars)))
        content[f"resources/{components[-1].parameter_set}"] = _parameter_set(components[-1], ssp)
    connections = [
        ("reference", "r", look_ahead, "x_d_ahead"),
        (look_ahead, sent, "drive", "x_d"),
        ("drive", "x_meas", look_ahead, "x_meas"),
    ]
    starts = {variable.name: variable.start for variable in components[1].variables}
    delay = int(starts["Np" if compensate is None else "preview"] or 0)
    stop_time = round((len(samples) - 1 + delay) * machine.T_s, 9)
    structure = _structure(machine.name, components, connections, machine.T_s, stop_time, ssp)
    write_whole(path, archived({"SystemStructure.ssd": structure, **content}))
    progress("done", 1.0)
    return Path(path)
