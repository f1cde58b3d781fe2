"""Documentation page and icon of an FMU: ``documentation/index.html`` from templates, ``model.png``."""

from __future__ import annotations

import html
from collections.abc import Mapping
from pathlib import Path
from string import Template

from ..machines.machine import Machine
from .content import fmu_title, paper_note
from .flavours import FMI_VERSIONS
from .fmi3_variables import fmi3_variables
from .tables import grouped_table
from .variables import variables_of

__all__ = ["filled", "icon", "index_page"]

_HERE = Path(__file__).parent

_PARTNERS = {"SepCompensator": ("SepCompensator", "x_dm")}
"""FMU between trajectory and drive on the wiring diagram, and its output to the drive; else HybridPredictor, x_d."""

_AGREEMENT_DIGITS = {"SepCompensator": 9}
"""Decimals, m, to which the reference agrees; else 11. The iteration for a bounded plan amplifies rounding."""

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
    """Return a template of ``fmi/templates`` with ``$name`` replaced by values, which are HTML."""
    text = (_HERE / "templates" / f"{template}.html").read_text(encoding="utf-8")
    return Template(text.rstrip("\n")).substitute(values)


def index_page(
    machine: Machine,
    description: Mapping[str, object],
    needs: str,
    *,
    reference: bool = False,
    limits: str = "",
    fmi: str = FMI_VERSIONS[0],
) -> bytes:
    """Return the documentation page of an FMU.

    Parameters
    ----------
    machine : Machine
        Its sources are listed.
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    needs : str
        Requirements of the FMU, one sentence.
    reference : bool
        Whether the archive has a reference result.
    limits : str
        Section on the limits of the FMU's flavour, HTML.
    fmi : {"2", "3"}
        Version of FMI, whose types are named.
    """
    model, name = str(description["model"]), str(description["name"])
    table = variables_of(description) if fmi == "2" else [each.shown for each in fmi3_variables(description)]
    rows = "\n".join(
        f'<tbody>\n<tr><th colspan="5" scope="rowgroup">{html.escape(heading)}</th></tr>\n{_rows(group)}\n</tbody>'
        for heading, group in grouped_table(table).items()
    )
    has_inputs = model != "ReferenceTrajectory"
    inputs = f', fed with <a href="reference/{name}_in.csv">reference/{name}_in.csv</a>' if has_inputs else ""
    digits = _AGREEMENT_DIGITS.get(model, 11)
    sources = _SOURCES.get(model, machine.sources) or ("none is named in the machine file",)
    partner, command = _PARTNERS.get(model, ("HybridPredictor", "x_d"))
    page = filled(
        "index",
        name=name,
        title=html.escape(fmu_title(machine, model) + paper_note(machine, model)),
        needs=html.escape(needs),
        computes=filled(model, steps=filled("steps")),
        partner=partner,
        command=command,
        rows=rows,
        reference=filled("reference", name=name, inputs=inputs, digits=digits) if reference else "",
        limits=limits,
        sources="\n".join(f"<li>{html.escape(source)}</li>" for source in sources),
    )
    return f"{page}\n".encode()


def _rows(group: list[tuple[str, str, str, str, str]]) -> str:
    return "\n".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in group)
