"""HAL component for LinuxCNC: its sources, and the folder of an axis that it loads.

The component (``integrations/linuxcnc/hsep.c``) is one file over the C core, for ``halcompile``; what one axis differs
in is read from a folder when the component is loaded, as an FMU reads its resources: the table ``variables.bin`` and,
of an axis that starts warm, ``weights.bin``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..base.data_files import data_folder
from ..base.errors import ParameterError
from ..machines.agree import check_drive_limits
from ..machines.machine import Machine
from .c_header import TABLE_FILE, c_sources, kind_header, table_file
from .spec import content_guid, table_of

if TYPE_CHECKING:
    from ..predict.predictor import HybridPredictor

__all__ = ["COMPONENTS", "axis_files", "check_names", "component_files"]

COMPONENTS = {"SepCompensator": "hsep", "HybridPredictor": "hsep_predictor"}
"""Name of the component of each model."""


_NAME_MAX = 47 - len("..look-ahead")
"""Letters that HAL leaves for the names of component and axis together: 47, less the longest pin's."""


def check_names(model: str, names: Sequence[str]) -> None:
    """Raise ParameterError if the names of a component's axes are too long for HAL, or one is there twice."""
    if len(set(names)) < len(names):
        raise ParameterError(f"each axis must have a name of its own, got {', '.join(names)}")
    most = _NAME_MAX - len(COMPONENTS[model])
    for name in names:
        if len(name) > most:
            raise ParameterError(
                f"an axis's name must have at most {most} letters, as HAL's names have 47, got {len(name)}: {name}; "
                "change the machine file's name"
            )


def component_files(model: str) -> dict[str, bytes]:
    """Return the sources of the component: name → content, ``<component>.c`` to be given to ``halcompile``.

    Parameters
    ----------
    model : {"SepCompensator", "HybridPredictor"}
    """
    name = COMPONENTS[model]
    text = (data_folder("integrations") / "linuxcnc" / "hsep.c").read_text(encoding="utf-8")
    sources = {**c_sources(versions=()), "hsep_fmu.h": kind_header(model).encode()}
    return {
        f"{name}.c": text.replace('"sources/all.c"', f'"{name}_sources/all.c"').encode(),
        **{f"{name}_sources/{file}": content for file, content in sources.items()},
    }


def axis_files(machine: Machine, model: str, trained: HybridPredictor | None = None) -> dict[str, bytes]:
    """Return the files of an axis' folder: name → content.

    Parameters
    ----------
    machine : Machine
    model : {"SepCompensator", "HybridPredictor"}
    trained : HybridPredictor, optional
        What an earlier run has learned.

    Raises
    ------
    FmuError
        If a compensator is asked for a machine without limits of its drive.
    """
    if model == "SepCompensator":
        check_drive_limits(machine, "--predictor writes the component that predicts alone")
    table = table_of(machine, model, machine.name, warm=trained is not None)
    files: dict[str, bytes] = {}
    if trained is not None:
        from .weights import WEIGHTS_FILE, weights_file

        files[WEIGHTS_FILE] = weights_file(trained)
    return {TABLE_FILE: table_file(table, content_guid(files, table)), **files}
