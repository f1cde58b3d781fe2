"""Output of ``hybridsep identify``: parameters with their deviations, structures that were tried, findings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rich import box
from rich.table import Table

from ..identify.frequency_response import IdentifiedResponse
from ..identify.model import IdentifiedModel
from ..logs.units import Shown
from .tables import console, print_json

__all__ = ["deviation_words", "print_identified", "shown_estimates"]


def print_identified(found: IdentifiedModel | IdentifiedResponse, as_json: bool, title: str, shown: Shown) -> None:
    """Print an identified model, as tables in the units of its log, or as JSON."""
    if as_json:
        print_json(dict(found.summary()))
        return
    console.print(_parameters(found, title, shown))
    if isinstance(found, IdentifiedModel):
        console.print(_structures(found, shown))
    elif found.criteria:
        console.print(_sizes(found))
    for finding in found.findings:
        console.print(f"- {finding}", highlight=False)


def deviation_words(std: float, sign: str = "") -> str:
    """Return a standard deviation as text; that of a parameter that was not estimated is no figure."""
    return f"{sign}{std:.2g}" if std > 0 else "fixed"


def shown_estimates(parameters: Iterable[Mapping[str, Any]], shown: Shown) -> Iterator[tuple[str, float, float, str]]:
    """Yield name, value, standard deviation and unit of parameters; positions in the units of their log."""
    for one in parameters:
        factor, unit = shown.error(abs(one["value"])) if one["unit"] in ("m", "rad") else (1.0, str(one["unit"]))
        yield str(one["name"]), factor * one["value"], factor * one["std"], unit


def _parameters(found: IdentifiedModel | IdentifiedResponse, title: str, shown: Shown) -> Table:
    chosen = found.structure if isinstance(found, IdentifiedModel) else f"{len(found.model.modes)} modes"
    table = Table("", "value", "± (1σ)", "unit", title=f"{title}: {chosen}, {found.input_hold}", box=box.SIMPLE)
    for name, value, std, unit in shown_estimates(map(vars, found.parameters), shown):
        table.add_row(name, f"{value:.7g}", deviation_words(std), "" if unit == "1" else unit)
    return table


def _structures(found: IdentifiedModel, shown: Shown) -> Table:
    factor, unit = shown.error(found.rms)
    table = Table(
        *("structure", "parameters", "fitted", "held out", ""),
        title=f"RMS error of the simulated position, in {unit}",
        box=box.SIMPLE,
    )
    for other in found.alternatives:
        remark = "chosen" if other.name == found.structure else other.objection
        errors = (f"{factor * other.rms_fitted:.4g}", f"{factor * other.rms_held_out:.4g}")
        table.add_row(other.name, str(other.n_parameters), *errors, remark)
    return table


def _sizes(found: IdentifiedResponse) -> Table:
    table = Table("modes", "RMS of the relative error", "BIC", "", title="Numbers of modes", box=box.SIMPLE)
    for n_modes, rms, criterion in found.criteria:
        chosen = "chosen" if n_modes == len(found.model.modes) else ""
        table.add_row(str(n_modes), f"{100 * rms:.3g} %", f"{criterion:.1f}", chosen)
    return table
