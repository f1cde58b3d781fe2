"""Generated files of the repository: settings and constants of the C core, and the pages of reference in ``docs``.

``python generate.py`` writes them anew after a change of a parameter or a variable; ``tests/test_generated.py`` tells
when one is out of date.
"""

from __future__ import annotations

import ast
import itertools
import re
import textwrap
from collections.abc import Mapping
from dataclasses import asdict
from inspect import cleandoc
from pathlib import Path
from typing import Any

from docs.reference_pages import pages
from hybridsep.base.parameters import Parameter
from hybridsep.base.settings import PARAMETERS
from hybridsep.fmi.variables import COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS, TRUST_SETTINGS
from hybridsep.predict import start_in_motion, uncertainty
from hybridsep.predict.trust import disturbances, experts, model, stack
from hybridsep.predict.trust.constants import CONSTANTS
from hybridsep.predict.trust.learned import LEARNED

ROOT = Path(__file__).resolve().parent
SETTINGS_HEADER = ROOT / "fmu_src" / "c" / "core" / "predict" / "hsep_settings.h"
CONSTANTS_HEADER = ROOT / "fmu_src" / "c" / "core" / "predict" / "trust" / "hsep_trust_constants.h"
LEARNED_HEADER = CONSTANTS_HEADER.with_name("hsep_trust_learned.h")
DECLARED_HEADER = SETTINGS_HEADER.with_name("hsep_predict_constants.h")
RANGES_HEADER = ROOT / "fmu_src" / "c" / "core" / "library" / "hsep_ranges.h"

DECLARED = {
    "uncertainty": uncertainty,
    "start": start_in_motion,
    "expert": experts,
    "stack": stack,
    "trusted": model,
    "disturbances": disturbances,
}
"""Modules whose constants the C core has, those with a name of their own and a reason behind them, by C's prefix."""

OF_LIBRARY = (
    *("N_COMPONENTS", "N_LEARNED", "_SHARE_LEAST", "_SHARE_MOST", "_NO_PENALTY"),
    *("_N_FRICTION", "_N_LASTING", "_N_PERIODIC", "_OWN_MAX", "_OWN_REACH"),
    *("HOLD", "LAGGED", "STATIC", "COMMAND", "DOUBTING"),
)
"""Constants of these modules that C has not, or among its layouts."""


def generated() -> dict[Path, str]:
    """Return the files that are generated, as they must be."""
    headers = {
        SETTINGS_HEADER: settings_header(),
        RANGES_HEADER: ranges_header(),
        CONSTANTS_HEADER: constants_header(),
        LEARNED_HEADER: learned_header(),
        DECLARED_HEADER: declared_header(),
    }
    return headers | pages()


def settings_header() -> str:
    """Return the C header of the settings of predictor and compensator."""
    lists = (("PREDICTOR", PREDICTOR_SETTINGS), ("TRUST", TRUST_SETTINGS), ("COMPENSATOR", COMPENSATOR_SETTINGS))
    return f"""/* Settings as they are declared in hybridsep/base/settings.py, from which this file is generated.
 * Whole numbers, truth values and choices are hsep_word. */
#ifndef HSEP_SETTINGS_H
#define HSEP_SETTINGS_H

#include "hsep_real.h"

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


def ranges_header() -> str:
    """Return the C header of the ranges and defaults of the library's parameters."""
    modes = {name: PARAMETERS[name] for name in ("f_n", "zeta", "alpha", "beta")}
    lists = (
        ("PREDICTOR", PREDICTOR_SETTINGS),
        ("TRUST", TRUST_SETTINGS),
        ("COMPENSATOR", COMPENSATOR_SETTINGS),
        ("MODE", modes),
    )
    return f"""/* Ranges of the library's parameters, generated from hybridsep/base/settings.py.
 *
 * RANGE(type, name, usual, least, most, nonzero, automatic, learned): the default; closed bounds; the least magnitude
 * of what is not 0, 0 if there is none; a value beside the range that stands for an automatic choice, or least again;
 * whether weights that were learned with another value mean something else. */
#ifndef HSEP_RANGES_H
#define HSEP_RANGES_H

/* clang-format off */
{"".join(_ranges(name, settings) for name, settings in lists)}/* clang-format on */

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
        defines = [f"#define HSEP_TRUST_{name.upper()} {_number(values[name])}" for name in names.split(", ")]
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
    ranges = "\n".join(
        f"#define HSEP_LEARNED_{name.upper()} {_number(one.least)}, {_number(one.most)}"
        for name, one in LEARNED.items()
    )
    return f"""/* Least and most of what the residual model with trust has learned, generated from
 * hybridsep/predict/trust/learned.py. */
#ifndef HSEP_TRUST_LEARNED_H
#define HSEP_TRUST_LEARNED_H

{ranges}

#endif
"""


def declared_header() -> str:
    """Return the C header of the constants that modules of the library declare beside what they compute."""
    parts = []
    for prefix, module in DECLARED.items():
        body = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8")).body
        for statement, reason in itertools.pairwise(body):
            if not (isinstance(statement, ast.Assign) and isinstance(reason, ast.Expr)):
                continue
            target = statement.targets[0]
            names = [one.id for one in ast.walk(target) if isinstance(one, ast.Name) and one.id.isupper()]
            used = [name for name in names if name not in OF_LIBRARY]
            if not used:
                continue
            text = " ".join(cleandoc(ast.literal_eval(reason.value)).replace("`", "").split())
            text = text.replace("λ", "lambda").replace("²", "2")
            lines = textwrap.wrap(f"{text} */", 114)
            defines = [
                f"#define HSEP_{prefix.upper()}_{name.lstrip('_')} {_initialiser(getattr(module, name))}"
                for name in used
            ]
            parts.append("\n".join(["/* " + "\n * ".join(lines), *defines]))
    return f"""/* Constants of predictions and their errors, generated from modules of hybridsep/predict. */
#ifndef HSEP_PREDICT_CONSTANTS_H
#define HSEP_PREDICT_CONSTANTS_H

{chr(10).join(f"{part}{chr(10)}" for part in parts)}
#endif
"""


def _initialiser(value: Any) -> str:
    """Return a number, or what stands between the braces of an array's initialiser."""
    if not isinstance(value, tuple):
        return _number(value)
    return ", ".join(f"{{{_initialiser(one)}}}" if isinstance(one, tuple) else _initialiser(one) for one in value)


def _number(value: Any) -> str:
    """Return a number as C has it: what single precision cannot hold in a macro that replaces it there."""
    if not isinstance(value, float) or 1e-36 <= abs(value) <= 1e30 or value == 0.0:
        return repr(value)
    return f"{'-' * (value < 0.0)}HSEP_{'TINY' if abs(value) < 1.0 else 'HUGE'}({abs(value)!r})"


def _list(name: str, settings: Mapping[str, Parameter]) -> str:
    rows: list[str] = []
    for setting, parameter in settings.items():
        kind = "hsep_real" if parameter.kind is float else "hsep_word"
        unit = "" if parameter.unit == "1" else f", {parameter.unit}"
        items = ", ".join(f"{number} {item}" for number, item in enumerate(parameter.choices))
        meaning = parameter.description.replace("·", " ") + (f": {items}" if items else unit)
        rows += [f"    /* {meaning} */", f"    SETTING({kind}, {setting})"]
    return f"#define HSEP_{name}_SETTINGS(SETTING) \\\n" + " \\\n".join(rows) + "\n\n"


def _ranges(name: str, settings: Mapping[str, Parameter]) -> str:
    rows = []
    for setting, parameter in settings.items():
        kind = "hsep_real" if parameter.kind is float else "hsep_word"
        usual = 0.0 if parameter.default is None else parameter.to_fmi(parameter.default)
        automatic = parameter.minimum if parameter.automatic is None else parameter.automatic
        numbers = (usual, parameter.minimum, parameter.maximum, parameter.nonzero, automatic)
        values = ", ".join(repr(float(number)) for number in numbers)
        rows.append(f"    RANGE({kind}, {setting}, {values}, {int(parameter.learned)})")
    return f"#define HSEP_{name}_RANGES(RANGE) \\\n" + " \\\n".join(rows) + "\n\n"


if __name__ == "__main__":
    for path, content in generated().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(content, encoding="utf-8")
