"""Documentation page and icon of an FMU: ``documentation/index.html`` from templates, ``model.png``."""

import html
import re
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from string import Template

from .description import described_variables
from .reference import AGREEMENT
from .spec import FmuSpec
from .variables import Variable

_HERE = Path(__file__).parent

_PLAIN_NAMES = {"2": "-DFMI2_FUNCTION_PREFIX=", "3": "-DFMI3_OVERRIDE_FUNCTION_PREFIX"}
"""Option with which the standard's headers give the FMI functions their plain names, by the version of FMI."""

_SOURCES = {
    "ReferenceTrajectory": (
        "C.-H. Chou, M. Duan, C. E. Okwudire: A linear hybrid model for enhanced servo error pre-compensation of feed "
        "drives with unmodeled nonlinear dynamics; the limits of eq. (14), the moves of its figures",
        "hybridsep computes the samples, one every T_s; the figures do not print the spiral's size",
    )
}
"""Sources of models that do not depend on the machine."""


def icon(model: str) -> bytes:
    """Return the PNG of a model's icon."""
    return (_HERE / "icons" / f"{model}.png").read_bytes()


def filled(template: str, **values: object) -> str:
    """Return a file of ``fmi/templates`` with ``$name`` replaced by values, which are HTML in HTML."""
    return Template((_HERE / "templates" / template).read_text(encoding="utf-8")).substitute(values)


def documentation(
    spec: FmuSpec, needs: str, dependencies: str, reference: Collection[str], *, limits: str = "", sources: str = ""
) -> dict[str, bytes]:
    """Return the pages of an FMU, ``documentation/index.html`` among them: archive name → content.

    ``spec``: the machine's sources are listed, and types named as its version of FMI has them; ``needs``,
    ``dependencies``: requirements of the FMU: one sentence, and in detail, the text of ``externalDependencies.txt``;
    ``reference``: collection: files of its reference run; empty if it has none; ``limits``, ``sources``: section on
    the limits of the FMU's flavour, and on compiling its sources, HTML.
    """
    model, name = spec.table.model, spec.table.name
    table = [
        one if size is None else replace(one, kind=f"{one.kind}[Np]")
        for one, size in described_variables(spec.table, spec.fmi)
    ]
    rows = "\n".join(
        f'<tbody>\n<tr><th colspan="6" scope="rowgroup">{html.escape(heading)}</th></tr>\n{_rows(group)}\n</tbody>'
        for heading, group in grouped_table(table).items()
    )
    run = {"name": name, "digits": AGREEMENT.get(model, 11), "inputs": ""}
    if model != "ReferenceTrajectory":
        run["inputs"] = f', fed with <a href="reference/{name}_in.csv">{name}_in.csv</a>'
    named = _SOURCES.get(model, spec.machine.sources) or ("none is named in the machine file",)
    # FMU between trajectory and drive on the wiring diagram, and its output to the drive
    partner, command = (model, "x_dm") if model == "SepCompensator" else ("HybridPredictor", "x_d")
    page = _section(
        "index",
        name=name,
        title=html.escape(spec.title),
        needs=html.escape(needs),
        computes=_section(model, steps=_section("steps"), residual=_section("residual")),
        partner=partner,
        command=command,
        rows=rows,
        reference=_section("reference", **run) if reference else "",
        limits=limits,
        compiling=sources,
        sources="\n".join(f"<li>{html.escape(source)}</li>" for source in named),
    )
    return {
        "documentation/index.html": f"{page}\n".encode(),
        "documentation/externalDependencies.txt": dependencies.encode(),
    }


def _section(template: str, **values: object) -> str:
    return filled(f"{template}.html", **values).rstrip("\n")


def compile_note(name: str, fmi: str) -> str:
    """Return the section on compiling the sources of an FMU with a model identifier, HTML."""
    return _section("compile", name=name, version=f"{fmi}.0", plain=_PLAIN_NAMES[fmi])


def _rows(group: list[tuple[str, str, str, str, str, str]]) -> str:
    return "\n".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in group)


def grouped_table(table: Iterable[Variable]) -> dict[str, list[tuple[str, str, str, str, str, str]]]:
    """Return ``(name, type and unit, display unit, start, range, meaning)`` by heading; items with what they mean."""
    in_one_row: dict[str, Variable] = {}  # of a window the first one as ``name[i]``
    for variable in table:
        in_one_row.setdefault(re.sub(r"^(\w+_window)\[\d+\]", r"\1[i]", variable.name), variable)
    groups: dict[str, list[tuple[str, str, str, str, str, str]]] = {}
    for name, variable in in_one_row.items():
        pairs = enumerate(zip(variable.items, variable.item_meanings, strict=True))
        items = ", ".join(f"{number} {item} ({meaning})" for number, (item, meaning) in pairs)
        meaning = f"{variable.description}: {items}" if items else variable.description
        kind = variable.kind if variable.unit in (None, "1") else f"{variable.kind}, {variable.unit}"
        start = "" if variable.start is None else f"{variable.start:.10g}"
        if variable.kind == "Boolean":
            start = start and str(variable.start).lower()
        row = (name, kind, variable.display_unit or "", start, _range(variable), meaning)
        groups.setdefault(variable.heading, []).append(row)
    return groups


def _range(variable: Variable) -> str:
    """Return the allowed values, an automatic choice and the least value that is not 0 included."""
    if variable.minimum is None or variable.maximum is None or variable.kind == "Boolean":
        return ""
    least = f"0 or {variable.nonzero:g}" if variable.nonzero else f"{variable.minimum:.10g}"
    if variable.minimum == variable.maximum:
        return least
    if variable.automatic is not None:
        least = f"{variable.automatic:g} or {least}"
    return f"{least} … {variable.maximum:.10g}"
