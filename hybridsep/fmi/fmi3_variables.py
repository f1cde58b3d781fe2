"""Variables of an FMI 3.0 FMU: the table of FMI 2.0 with other types, windows as arrays, and the time."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .c_header import layout_of
from .fmu_table import FmuTable
from .variables import Variable

__all__ = ["Fmi3Variable", "fmi3_variables"]

_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}

_TIME = Variable("time", "Real", "independent", "continuous", "simulation time", unit="s")


@dataclass(frozen=True)
class Fmi3Variable:
    """One FMI 3.0 variable; its value reference is its place in the list.

    Attributes
    ----------
    variable : Variable
        With a type of FMI 3.0 as its kind.
    size : int or None
        Number of elements of an array of one dimension; None if it is scalar.
    """

    variable: Variable
    size: int | None = None

    @property
    def shown(self) -> Variable:
        """As a table of the interface shows it: an array's type with its size."""
        own = self.variable
        return own if self.size is None else replace(own, kind=f"{own.kind}[{self.size}]")


def fmi3_variables(table: FmuTable) -> list[Fmi3Variable]:
    """Return the variables: single ones, then the modes, then windows, then the time.

    Parameters
    ----------
    table : FmuTable
    """
    layout = layout_of(table.shown)
    found = [Fmi3Variable(variable) for variable in (*layout.scalars, *layout.modes)]
    for window in layout.windows:
        name = window[0].name.partition("[")[0]
        found.append(Fmi3Variable(replace(window[0], name=name), size=len(window)))
    found.append(Fmi3Variable(_TIME))
    return [replace(each, variable=replace(each.variable, kind=_TYPES[each.variable.kind])) for each in found]
