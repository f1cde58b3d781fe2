"""C header ``hsep_fmu.h`` of one FMU: its variable table and value references.

The native FMUs' sources differ in this header alone. It is made from the same table as the
modelDescription, so the two cannot disagree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .variables import INTERPOLATED, Variable, variables_of

__all__ = ["c_header"]

_C_KINDS = {"Enumeration": "Integer"}
"""FMI 2.0 reads and writes both by the same functions."""


def c_header(description: Mapping[str, object], guid: str) -> str:
    """Return the header of one FMU.

    Parameters
    ----------
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``, as :func:`hybridsep.fmi.variables.variables_of` reads it.
    guid : str
        The modelDescription's.
    """
    table = variables_of(description)
    n_modes = sum(variable.name.endswith("].f_n") for variable in table)
    window = sum(variable.name.startswith("x_h_window[") for variable in table)
    model, name = _model_macro(str(description["model"]), n_modes), str(description["name"])
    slopes = INTERPOLATED[str(description["model"])]
    assert slopes == tuple(variable.name for variable in table[: len(slopes)])  # their places are the inputs' own
    rows = "\n".join(f"    {_row(variable)}," for variable in table)
    places = [f"    HSEP_VR_{name} = {place}" for name, place in _references(table).items()]
    places += [f"    HSEP_SLOPE_{name} = HSEP_N_VARIABLES + HSEP_VR_{name}" for name in slopes]
    references = ",\n".join(places)
    return f"""/* The interface of {name}: generated from the table that modelDescription.xml comes from. */
#ifndef HSEP_FMU_H
#define HSEP_FMU_H

#include <math.h>

#include "hsep_model.h"

/* What fmi2Functions.h may put before the names of the FMI functions. */
#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX {name}_
#endif

#define HSEP_MODEL_IDENTIFIER {_string(name)}
#define HSEP_GUID {_string(guid)}
#define HSEP_MODEL_{model} 1
#define HSEP_N_VARIABLES {len(table)}
#define HSEP_N_INTERPOLATED {len(slopes)} /* the first variables, inputs with a time derivative */
#define HSEP_N_VALUES (HSEP_N_VARIABLES + HSEP_N_INTERPOLATED)
#define HSEP_N_MODES {n_modes}
#define HSEP_WINDOW {window} /* samples in the window variables, 0 where there are none */

/* Value references; of an array's elements the first one. Behind them the places of the time derivatives. */
enum {{
{references}
}};

static const hsep_variable hsep_variables[HSEP_N_VARIABLES] = {{
{rows}
}};

#endif
"""


def _model_macro(model: str, n_modes: int) -> str:
    if model == "FeedDrive":
        return "STAGE_DRIVE" if n_modes else "FEED_DRIVE"
    macros = {
        "HybridPredictor": "HYBRID_PREDICTOR",
        "SepCompensator": "SEP_COMPENSATOR",
        "ReferenceTrajectory": "REFERENCE_TRAJECTORY",
    }
    return macros[model]


def _references(table: Sequence[Variable]) -> dict[str, int]:
    """Return the value reference of each plain variable and of each array's first element."""
    places: dict[str, int] = {}
    for place, variable in enumerate(table):
        places.setdefault(variable.name.partition("[")[0], place)
    return places


def _row(variable: Variable) -> str:
    unit = "" if variable.unit in (None, "1") else str(variable.unit)
    fields = [
        _string(variable.name),
        _string(unit),
        f"HSEP_{_C_KINDS.get(variable.kind, variable.kind).upper()}",
        f"HSEP_{variable.causality.upper()}",
        str(int(variable.variability == "tunable")),
        _double(variable.start or 0.0),
        "-HUGE_VAL" if variable.minimum is None else _double(variable.minimum),
        "HUGE_VAL" if variable.maximum is None else _double(variable.maximum),
        _double(variable.nonzero),
        "HUGE_VAL" if variable.automatic is None else _double(variable.automatic),
        str(int(variable.learned)),
    ]
    return "{" + ", ".join(fields) + "}"


def _double(value: float) -> str:
    """Write a number so that a C compiler reads the same double back: the shortest digits that do."""
    return repr(float(value))


def _string(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
