"""Output of ``hybridsep identify``: parameters with their deviations, structures that were tried, findings."""

from __future__ import annotations

from rich import box
from rich.table import Table

from ..identify.frequency_response import IdentifiedResponse
from ..identify.model import IdentifiedModel
from .tables import console, print_json

__all__ = ["print_identified"]


def print_identified(found: IdentifiedModel | IdentifiedResponse, as_json: bool, title: str) -> None:
    """Print an identified model, as tables or as JSON."""
    if as_json:
        print_json(dict(found.summary()))
        return
    console.print(_parameters(found, title))
    if isinstance(found, IdentifiedModel):
        console.print(_structures(found))
    elif found.criteria:
        console.print(_sizes(found))
    for finding in found.findings:
        console.print(f"- {finding}", highlight=False)


def _parameters(found: IdentifiedModel | IdentifiedResponse, title: str) -> Table:
    chosen = found.structure if isinstance(found, IdentifiedModel) else f"{len(found.model.modes)} modes"
    table = Table("", "value", "± (1σ)", "unit", title=f"{title}: {chosen}, {found.input_hold}", box=box.SIMPLE)
    for estimate in found.parameters:
        deviation = f"{estimate.std:.2g}" if estimate.std > 0 else "as chosen"
        table.add_row(estimate.name, f"{estimate.value:.7g}", deviation, "" if estimate.unit == "1" else estimate.unit)
    return table


def _structures(found: IdentifiedModel) -> Table:
    table = Table(
        *("structure", "parameters", "fitted", "held out", ""),
        title=f"RMS error of the simulated position, in µ{found.unit}",
        box=box.SIMPLE,
    )
    for other in found.alternatives:
        remark = "chosen" if other.name == found.structure else other.objection
        errors = (f"{1e6 * other.rms_fitted:.4g}", f"{1e6 * other.rms_held_out:.4g}")
        table.add_row(other.name, str(other.n_parameters), *errors, remark)
    return table


def _sizes(found: IdentifiedResponse) -> Table:
    table = Table("modes", "RMS of the relative error", "BIC", "", title="Numbers of modes", box=box.SIMPLE)
    for n_modes, rms, criterion in found.criteria:
        chosen = "chosen" if n_modes == len(found.model.modes) else ""
        table.add_row(str(n_modes), f"{100 * rms:.3g} %", f"{criterion:.1f}", chosen)
    return table
