"""Files for controllers that take no FMU as it is: LinuxCNC's component, an axis's C header, TwinCAT's configuration.

The HAL component (``integrations/linuxcnc/hsep.c``) is one file over the C core, for ``halcompile``; what one axis
differs in is read from a folder when the component is loaded, as an FMU reads its resources: the table
``variables.bin`` and, of an axis that starts warm, ``weights.bin``.

The C header gives an axis to the library in C (``fmu_src/c``): its modes, settings and weights, as ``hsep.h`` takes
them, for C99 and C++11; each number is the machine file's to the last bit, as weights are refused with others.

Beckhoff's TE1420, Target for FMI, puts an FMU's sources into a project of Visual Studio; what a tool's sources need
there stands in an XML file of the form of its ``CustomFMU.xml``, which it finds in its folder of program data.
"""

from collections.abc import Sequence
from pathlib import Path

from ..base.errors import ParameterError
from ..base.files import data_folder, write_whole
from ..base.version import __version__
from ..machines.machine import Machine
from .c_header import TABLE_FILE, c_bytes, c_sources, kind_header, table_file
from .flavours import filled
from .spec import content_guid, table_of
from .variables import AVERAGING_SETTINGS, COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS
from .weights import WEIGHTS_FILE

COMPONENTS = {"SepCompensator": "hsep", "HybridPredictor": "hsep_predictor"}  # name of the component of each model


def check_names(model: str, names: Sequence[str]) -> None:
    """Raise ParameterError if the names of a component's axes are too long for HAL, or one is there twice."""
    if len(set(names)) < len(names):
        raise ParameterError(f"each axis must have a name of its own, got {', '.join(names)}")
    most = 47 - len(f"{COMPONENTS[model]}..look-ahead")  # HAL's 47 letters, less those of component and longest pin
    for name in names:
        if len(name) > most:
            raise ParameterError(
                f"an axis's name must have at most {most} letters, as HAL's names have 47, got {len(name)}: {name}; "
                "change the machine file's name"
            )


def component_files(model: str) -> dict[str, bytes]:
    """Return the sources of a model's component: name → content, ``<component>.c`` to be given to ``halcompile``."""
    name = COMPONENTS[model]
    text = (data_folder("integrations") / "linuxcnc" / "hsep.c").read_text(encoding="utf-8")
    sources = {**c_sources(versions=()), "hsep_fmu.h": kind_header(model).encode()}
    return {
        f"{name}.c": text.replace('"sources/all.c"', f'"{name}_sources/all.c"').encode(),
        **{f"{name}_sources/{file}": content for file, content in sources.items()},
    }


def axis_files(machine: Machine, model: str, weights: bytes | None = None) -> dict[str, bytes]:
    """Return the files of an axis' folder, with the weights file of an earlier run: name → content.

    MachineError if a compensator is asked for a machine without limits of its drive.
    """
    if model == "SepCompensator":
        machine.check_section("drive_limits", ", or write a predictor's (--predictor)")
    table = table_of(machine, model, machine.name, warm=weights is not None)
    files = {} if weights is None else {WEIGHTS_FILE: weights}
    return {TABLE_FILE: table_file(table, content_guid(files, table)), **files}


def axis_header(machine: Machine, model: str, weights: bytes | None = None) -> str:
    """Return the header's text, with a weights file; MachineError if a compensator has no limits of its drive."""
    compensates = model == "SepCompensator"
    if compensates:
        machine.check_section("drive_limits", ", or write a predictor's (--predictor)")
    numbers = machine.fmi_compensator_parameters() if compensates else machine.fmi_parameters()
    parts = {"predictor": PREDICTOR_SETTINGS, "averaging": AVERAGING_SETTINGS, "compensator": COMPENSATOR_SETTINGS}
    settings = [
        f"    parameters->{part}.{name} = {numbers[name] + 0!r};"  # truth values are numbers there
        for part, names in parts.items()
        for name in names
        if name in numbers
    ]
    modes = [f"    {{{mode.f_n!r}, {mode.zeta!r}, {mode.alpha!r}, {mode.beta!r}}}," for mode in machine.model.modes]
    name, kind = machine.name, "compensator" if compensates else "predictor"
    lines = {"modes": "\n".join(modes), "weights": _weights(name, weights), "settings": "\n".join(settings)}
    return filled("axis.h", version=__version__, name=name, kind=kind, n_modes=len(modes), **lines)


def _weights(name: str, content: bytes | None) -> str:
    """Return the lines that declare the weights: none, or the content of a weights file."""
    size = f"static const size_t {name}_weights_size ="
    if content is None:
        none = f"static const void *const {name}_weights = NULL;"
        return f"/* Nothing was learned before: it starts cold. */\n{none}\n{size} 0;"
    learned = c_bytes(f"{name}_weights", content)
    return f"/* What an earlier run has learned. */\n{learned}\n{size} sizeof {name}_weights;"


CONFIGURATION_FILE = "CustomFMU_hybridsep.xml"  # beside the archives, where the template has another name
DEFINITIONS = ("HSEP_NO_FILES", "HSEP_NO_STDIO")  # macros: the runtime opens no files, and has printf in part only


def write_configuration(out: Path, fmi: str) -> Path:
    """Write the configuration for native FMUs of a version of FMI beside them, into a folder; return its path.

    ``all.c`` includes all their other sources, which are excluded from the build one by one.
    """
    excluded = sorted(name for name in c_sources((fmi,)) if name.endswith(".c") and name != "all.c")
    values = {"definitions": ";".join(DEFINITIONS), "excluded": ";".join(excluded)}
    tool = f"hybridsep {__version__}"  # the generationTool of modelDescription.xml
    write_whole(out / CONFIGURATION_FILE, filled("CustomFMU.xml", tool=tool, **values))
    return out / CONFIGURATION_FILE
