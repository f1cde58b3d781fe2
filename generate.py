"""Generated files of the repository: settings and constants of the C core, and the pages of reference in ``docs``.

``python generate.py`` writes them anew after a change of a parameter or a variable; ``tests/test_generated.py`` tells
when one is out of date.
"""

from __future__ import annotations

import ast
import itertools
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import ModuleType
from typing import Any

from docs.reference_pages import pages
from hybridsep.base.parameters import Parameter
from hybridsep.base.settings import PARAMETERS
from hybridsep.compensate import limits, newton, planning, qp, splines, stop
from hybridsep.fmi.variables import AVERAGING_SETTINGS, COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS
from hybridsep.predict import uncertainty
from hybridsep.predict.averaging import experts, features, model, recall, stacking, start
from hybridsep.predict.averaging.constants import CONSTANTS

ROOT = Path(__file__).resolve().parent
SETTINGS_HEADER = ROOT / "fmu_src" / "c" / "core" / "library" / "hsep_settings.h"
CONSTANTS_HEADER = ROOT / "fmu_src" / "c" / "core" / "predict" / "hsep_predict_constants.h"
PLAN_CONSTANTS_HEADER = ROOT / "fmu_src" / "c" / "core" / "compensate" / "hsep_plan_constants.h"

Declared = Mapping[str, list[ModuleType]]

PREDICTIONS: Declared = {
    "uncertainty": [uncertainty],
    "start": [start],
    "stacking": [stacking],
    "experts": [experts],
    "features": [features],
    "recall": [recall],
    "averaging": [model],
}
"""Modules whose constants the C core has, those with a name of their own and a reason after them, by C's prefix."""

PLANS: Declared = {
    "splines": [splines],
    "qp": [qp],
    "limits": [limits],
    "newton": [newton],
    "planning": [planning],
    "stop": [stop],
}
"""Modules of plans, likewise."""

PLACES = (
    "MODEL_RESIDUAL",
    "COMMAND_RESIDUAL",
    "N_RESIDUALS",
    "N_DECIDED",
)
"""Constants without a prefix in C."""

OF_LIBRARY = ("_OWN_MAX", "_OWN_REACH", "REGRESSIONS", "_FIRST")
"""Constants of these modules that C has not."""


def generated() -> dict[Path, str]:
    """Return the files that are generated, as they must be."""
    headers = {
        SETTINGS_HEADER: settings_header(),
        CONSTANTS_HEADER: constants_header(),
        PLAN_CONSTANTS_HEADER: plan_constants_header(),
    }
    return headers | pages()


def settings_header() -> str:
    """Return the C header of the settings of predictor and compensator, with the ranges of a mode's numbers."""
    lists = (
        ("predictor", PREDICTOR_SETTINGS),
        ("averaging", AVERAGING_SETTINGS),
        ("compensator", COMPENSATOR_SETTINGS),
        ("mode", {name: PARAMETERS[name] for name in ("f_n", "zeta", "alpha", "beta")}),
    )
    return f"""/* Settings as they are declared in hybridsep/base/settings.py, from which this file is generated.
 * Whole numbers, truth values and choices are hsep_int, those that may be negative hsep_signed.
 *
 * SETTING(of, type, name, usual, least, most, nonzero, automatic, learned): the default; closed bounds; the least
 * magnitude of what is not 0, 0 if there is none; a value beside the range that stands for an automatic choice, or
 * least again; whether weights that were learned with another value mean something else. */
#ifndef HSEP_SETTINGS_H
#define HSEP_SETTINGS_H

#include "hsep_real.h"

/* clang-format off */
{"".join(_list(name, settings) for name, settings in lists)}/* clang-format on */

#define HSEP_SETTING(of, type, name, ...) type name;

typedef struct {{
    HSEP_PREDICTOR_SETTINGS(HSEP_SETTING)
}} hsep_predictor_settings;

typedef struct {{
    HSEP_AVERAGING_SETTINGS(HSEP_SETTING)
}} hsep_averaging_settings;

typedef struct {{
    HSEP_COMPENSATOR_SETTINGS(HSEP_SETTING)
}} hsep_compensator_settings;

/* Samples by which the measurement is late; 0 where it comes a sample early. */
static inline hsep_int hsep_late(const hsep_predictor_settings *settings)
{{
    return settings->measurement_delay > 0 ? (hsep_int)settings->measurement_delay : 0;
}}

#endif
"""


def constants_header() -> str:
    """Return the C header of the constants of predictions, which the library declares with their reasons."""
    defines = [_experts(), *_defines(PREDICTIONS)]
    averaging = [f"#define HSEP_AVERAGING_{name.upper()} {_number(value)}" for name, value in asdict(CONSTANTS).items()]
    defines.append("\n".join(["/* hybridsep/predict/averaging/constants.py */", *averaging]))
    return _constants("HSEP_PREDICT_CONSTANTS_H", "predictions and their errors", defines)


def _experts() -> str:
    """Return the places of the experts in the stack, and what they are."""
    rows = [f"#define HSEP_{one.name.upper()} {one.place}" for one in experts.EXPERTS]
    places = [one.place for one in experts.REGRESSIONS]
    numbers = {"N_EXPERTS": len(experts.EXPERTS), "REGRESSIONS": places[0], "REGRESSIONS_END": places[-1] + 1}
    numbers["N_REGRESSIONS"] = len(places)
    rows += [f"#define HSEP_{name} {number}" for name, number in numbers.items()]
    table = ", ".join(
        f"{{{one.first_weight}, {one.target}, {int(one.has_lags)}, {int(one.is_fresh)}}}"
        if isinstance(one, experts.Regression)
        else f"{{{one.first_weight}, 0, 0, 0}}"
        for one in experts.EXPERTS
    )
    rows.append(f"/* First weight, target, whether it has lags, whether it is fresh */\n#define HSEP_EXPERTS {table}")
    return "\n".join(
        ["/* hybridsep/predict/averaging/experts.py: EXPERTS; those that rows train are in a row */", *rows]
    )


def plan_constants_header() -> str:
    """Return the C header of the constants of plans, which the library declares with their reasons."""
    return _constants("HSEP_PLAN_CONSTANTS_H", "plans", _defines(PLANS))


def _constants(guard: str, what: str, defines: list[str]) -> str:
    """Return a C header of constants."""
    body = "\n\n".join(defines)
    return f"""/* Constants of {what}, generated: what each means, and why, is in its file. */
#ifndef {guard}
#define {guard}

/* clang-format off */
{body}
/* clang-format on */

#endif
"""


def _defines(declared: Declared) -> list[str]:
    """Return the macros of each prefix's modules."""
    defines = []
    for prefix, modules in declared.items():
        files = ", ".join(f"{module.__name__.replace('.', '/')}.py" for module in modules)
        rows = [
            f"#define HSEP_{'' if name in PLACES else f'{prefix.upper()}_'}{name.lstrip('_')} "
            f"{_initialiser(getattr(module, name))}"
            for module in modules
            for name in _declared(module)
        ]
        defines.append("\n".join([f"/* {files} */", *rows]))
    return defines


def _declared(module: ModuleType) -> list[str]:
    """Return the names of a module's constants that C has: with a reason, a comment or a text, after them."""
    names: list[str] = []
    text = Path(module.__file__ or "").read_text(encoding="utf-8")
    lines = text.splitlines()
    for statement, after in itertools.pairwise([*ast.parse(text).body, None]):
        if not isinstance(statement, ast.Assign):
            continue
        if "  # " in lines[(statement.end_lineno or 0) - 1] or isinstance(after, ast.Expr):
            nodes = ast.walk(statement.targets[0])
            names += [one.id for one in nodes if isinstance(one, ast.Name) and one.id.isupper()]
    return [name for name in names if name not in OF_LIBRARY]


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


def _c_type(parameter: Parameter) -> str:
    return "hsep_real" if parameter.kind is float else "hsep_signed" if parameter.minimum < 0 else "hsep_int"


def _list(of: str, settings: Mapping[str, Parameter]) -> str:
    rows: list[str] = []
    for setting, parameter in settings.items():
        unit = "" if parameter.unit == "1" else f", {parameter.unit}"
        items = ", ".join(f"{number} {item}" for number, item in enumerate(parameter.choices))
        meaning = parameter.description.replace("·", " ") + (f": {items}" if items else unit)
        usual = 0.0 if parameter.default is None else parameter.to_fmi(parameter.default)
        automatic = parameter.minimum if parameter.automatic is None else parameter.automatic
        numbers = (usual, parameter.minimum, parameter.maximum, parameter.nonzero, automatic)
        values = ", ".join(repr(float(number)) for number in numbers)
        row = f"    SETTING({of}, {_c_type(parameter)}, {setting}, {values}, {int(parameter.learned)})"
        rows += [f"    /* {meaning} */", row]
    return f"#define HSEP_{of.upper()}_SETTINGS(SETTING) \\\n" + " \\\n".join(rows) + "\n\n"


if __name__ == "__main__":
    for path, content in generated().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(content, encoding="utf-8")
