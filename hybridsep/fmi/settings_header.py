"""C header ``hsep_settings.h``: the settings of predictor and compensator for the C core.

``python -m hybridsep.fmi.settings_header`` regenerates it after a change of :mod:`hybridsep.base.settings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..base.data_files import data_folder
from ..base.parameters import Parameter
from .variables import COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS, TRUST_SETTINGS

__all__ = ["settings_header", "settings_header_path"]


def settings_header() -> str:
    """Return the header."""
    lists = (("PREDICTOR", PREDICTOR_SETTINGS), ("TRUST", TRUST_SETTINGS), ("COMPENSATOR", COMPENSATOR_SETTINGS))
    return f"""/* Settings as they are declared in hybridsep/base/settings.py, from which this file is generated.
 * Whole numbers, truth values and choices are uint64_t. */
#ifndef HSEP_SETTINGS_H
#define HSEP_SETTINGS_H

#include <stdint.h>

/* clang-format off */
{"".join(_list(name, settings) for name, settings in lists)}/* clang-format on */

#define HSEP_SETTING(type, name) type name;

typedef struct {{
    HSEP_PREDICTOR_SETTINGS(HSEP_SETTING)
}} hsep_predictor_settings;

typedef struct {{
    HSEP_TRUST_SETTINGS(HSEP_SETTING)
}} hsep_trust_settings;

typedef struct {{
    HSEP_COMPENSATOR_SETTINGS(HSEP_SETTING)
}} hsep_compensator_settings;

#endif
"""


def settings_header_path() -> Path:
    """Return the header's path."""
    return data_folder("fmu_src") / "c" / "core" / "predict" / "hsep_settings.h"


def _list(name: str, settings: Mapping[str, Parameter]) -> str:
    rows: list[str] = []
    for setting, parameter in settings.items():
        kind = "double" if parameter.kind is float else "uint64_t"
        unit = "" if parameter.unit == "1" else f", {parameter.unit}"
        items = ", ".join(f"{number} {item}" for number, item in enumerate(parameter.choices))
        meaning = parameter.description.replace("·", " ") + (f": {items}" if items else unit)
        rows += [f"    /* {meaning} */", f"    SETTING({kind}, {setting})"]
    return f"#define HSEP_{name}_SETTINGS(SETTING) \\\n" + " \\\n".join(rows) + "\n\n"


if __name__ == "__main__":
    settings_header_path().write_text(settings_header(), encoding="utf-8")
