"""Generated files of the repository: settings and constants of the C core, and the pages of reference in ``docs``.

``python generate.py`` writes them anew after a change of a parameter or a variable; ``tests/test_generated.py`` tells
when one is out of date.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from dataclasses import asdict
from inspect import cleandoc
from pathlib import Path

from docs.reference_pages import pages
from hybridsep.base.parameters import Parameter
from hybridsep.fmi.variables import COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS, TRUST_SETTINGS
from hybridsep.predict.trust.constants import CONSTANTS
from hybridsep.predict.trust.learned import LEARNED

ROOT = Path(__file__).resolve().parent
SETTINGS_HEADER = ROOT / "fmu_src" / "c" / "core" / "predict" / "hsep_settings.h"
CONSTANTS_HEADER = ROOT / "fmu_src" / "c" / "core" / "predict" / "trust" / "hsep_trust_constants.h"
LEARNED_HEADER = CONSTANTS_HEADER.with_name("hsep_trust_learned.h")


def generated() -> dict[Path, str]:
    """Return the files that are generated, as they must be."""
    headers = {
        SETTINGS_HEADER: settings_header(),
        CONSTANTS_HEADER: constants_header(),
        LEARNED_HEADER: learned_header(),
    }
    return headers | pages()


def settings_header() -> str:
    """Return the C header of the settings of predictor and compensator."""
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


def constants_header() -> str:
    """Return the C header of the constants of the residual model with trust, each group behind its description."""
    values = asdict(CONSTANTS)
    _, attributes = cleandoc(type(CONSTANTS).__doc__ or "").split("----------\n")
    groups = re.findall(r"^(\w[\w, ]*) : (?:float|int)\n((?: .*\n?)+)", attributes, re.MULTILINE)
    found = [name for names, _ in groups for name in names.split(", ")]
    if found != list(values):
        raise AssertionError(f"constants must be described in their order, {list(values)}, got {found}")
    parts = []
    for names, description in groups:
        text = " ".join(description.replace("`", "").split())
        lines = textwrap.wrap(f"{text} */", 114)
        defines = [f"#define HSEP_TRUST_{name.upper()} {values[name]!r}" for name in names.split(", ")]
        parts.append("\n".join(["/* " + "\n * ".join(lines), *defines]))
    body = "\n\n".join(parts)
    return f"""/* Constants of the residual model with trust, generated from hybridsep/predict/trust/constants.py. */
#ifndef HSEP_TRUST_CONSTANTS_H
#define HSEP_TRUST_CONSTANTS_H

{body}

#endif
"""


def learned_header() -> str:
    """Return the C header of the ranges of what the residual model with trust has learned."""
    ranges = "\n".join(f"#define HSEP_LEARNED_{name.upper()} {one.least}, {one.most}" for name, one in LEARNED.items())
    return f"""/* Least and most of what the residual model with trust has learned, generated from
 * hybridsep/predict/trust/learned.py. */
#ifndef HSEP_TRUST_LEARNED_H
#define HSEP_TRUST_LEARNED_H

{ranges}

#endif
"""


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
    for path, content in generated().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(content, encoding="utf-8")
