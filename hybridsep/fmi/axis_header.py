"""C header of an axis for the library in C (``fmu_src/c``): its modes, settings and weights, as ``hsep.h`` takes them.

For C99 and C++11; each number is the machine file's to the last bit, as weights are refused with others.
"""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from ..base.version import __version__
from ..machines.agree import check_drive_limits
from ..machines.machine import Machine
from .variables import COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS, TRUST_SETTINGS

if TYPE_CHECKING:
    from ..predict.predictor import HybridPredictor

__all__ = [
    "axis_header",
]

_PARTS = {"predictor": PREDICTOR_SETTINGS, "trust": TRUST_SETTINGS, "compensator": COMPENSATOR_SETTINGS}


def axis_header(machine: Machine, model: str, trained: HybridPredictor | None = None) -> str:
    """Return the header's text.

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
    compensates = model == "SepCompensator"
    if compensates:
        check_drive_limits(machine, "--predictor writes the header of a predictor")
    numbers = machine.fmi_compensator_parameters() if compensates else machine.fmi_parameters()
    settings = [
        f"    parameters->{part}.{name} = {numbers[name] + 0!r};"  # truth values are numbers there
        for part, names in _PARTS.items()
        for name in names
        if name in numbers
    ]
    modes = [f"    {{{mode.f_n!r}, {mode.zeta!r}, {mode.alpha!r}, {mode.beta!r}}}," for mode in machine.model.modes]
    kind, name, guard = "compensator" if compensates else "predictor", machine.name, f"HSEP_AXIS_{machine.name}_H"
    lines = [
        f"/* Axis of hybridsep {__version__}: {name}, its {kind}, for hsep.h.",
        " *",
        " *     hsep_parameters parameters;",
        f" *     {name}_parameters(&parameters);",
        f" *     hsep_{kind}_init(block, &parameters, start, {name}_weights, {name}_weights_size);",
        " */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        '#include "hsep.h"',
        "",
        "/* f_n, Hz; zeta; alpha, 1/s^2; beta, 1/s */",
        f"static const hsep_mode {name}_modes[] = {{",
        *modes,
        "};",
        "",
        *_weights(name, trained),
        "",
        "/* Fill in its settings and modes. */",
        f"static inline void {name}_parameters(hsep_parameters *parameters)",
        "{",
        "    hsep_defaults(parameters);",
        *settings,
        f"    parameters->n_modes = {len(modes)};",
        f"    parameters->modes = {name}_modes;",
        "}",
        "",
        "#endif",
    ]
    return "".join(f"{line}\n" for line in lines)


def _weights(name: str, trained: HybridPredictor | None) -> list[str]:
    """Return the lines that declare the weights: none, or the content of a weights file."""
    if trained is None:
        return [
            "/* Nothing was learned before: it starts cold. */",
            f"static const void *const {name}_weights = NULL;",
            f"static const size_t {name}_weights_size = 0;",
        ]
    from .weights import weights_file

    content = weights_file(trained)
    numbers = textwrap.wrap(", ".join(map(str, content)), 112)
    return [
        "/* What an earlier run has learned. */",
        f"static const unsigned char {name}_weights[] = {{",
        *(f"    {line}" for line in numbers),
        "};",
        f"static const size_t {name}_weights_size = sizeof {name}_weights;",
    ]
