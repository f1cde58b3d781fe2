"""Scalar variables of FMI 2.0, section 2.2.7: their defaults and the combinations of their attributes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from xml.etree import ElementTree as ET

_CAUSALITIES = {
    "constant": {"output", "local"},
    "fixed": {"parameter", "calculatedParameter", "local"},
    "tunable": {"parameter", "calculatedParameter", "local"},
    "discrete": {"input", "output", "local"},
    "continuous": {"input", "output", "local", "independent"},
}
"""Causalities that go with a variability."""

_INITIAL_CALCULATED = ("calculated", "approx")
_INITIAL_ANY = ("calculated", "exact", "approx")


class Variable:
    """One ``ScalarVariable``, with the defaults of the attributes it leaves out.

    Parameters
    ----------
    element : Element
    types : mapping
        ``SimpleType`` elements by name.
    """

    def __init__(self, element: ET.Element, types: Mapping[str, ET.Element]) -> None:
        self.element = element
        self.kind = next(child for child in element if child.tag != "Annotations")
        self.base = self.kind.tag
        declared = types.get(self.kind.get("declaredType", ""))
        self.type = None if declared is None else declared[0]
        self.name = element.get("name", "")
        self.reference = element.get("valueReference", "")
        self.start = self.kind.get("start")
        self.causality = element.get("causality", "local")
        self.variability = element.get("variability", "continuous" if self.base == "Real" else "discrete")
        self.initials = self._initials()
        self.initial = element.get("initial", self.initials[0] if self.initials else None)

    @property
    def settable(self) -> bool:
        """Whether an importer may set it."""
        return self.causality in ("input", "parameter") or (
            self.variability != "constant" and self.initial in ("exact", "approx")
        )

    @property
    def items(self) -> set[float]:
        """Values of an Enumeration's items."""
        return set() if self.type is None else {float(item.get("value", "nan")) for item in self.type}

    def own(self, name: str) -> str | None:
        """Return an attribute of the variable itself, not its type's."""
        return self.kind.get(name)

    def number(self, name: str) -> float | None:
        """Return a numeric attribute, of the type where the variable has none."""
        if self.base in ("Boolean", "String"):
            return None
        text = self.own(name)
        if text is None and self.type is not None and name != "start":
            text = self.type.get(name)
        return None if text is None else float(text)

    def known(self, *, initially: bool, state: bool) -> bool:
        """Return whether an unknown may depend on it, at initialization or later."""
        if self.causality in ("input", "independent"):
            return True
        return self.initial == "exact" if initially else state

    def misfits(self) -> Iterator[str]:
        """Yield each combination of causality, variability, initial and start that the tables do not have."""
        if self.causality not in _CAUSALITIES[self.variability]:
            yield f"{self.name} is {self.variability} and {self.causality}"
            return
        if self.variability == "continuous" and self.base != "Real":
            yield f"{self.name} is continuous, but no Real"
        if self.causality == "independent" and self.base != "Real":
            yield f"{self.name} is independent, but no Real"
        if self.initial is not None and self.initial not in self.initials:
            yield f"{self.name} is {self.causality} and {self.variability} with initial = {self.initial}"
        needs_start = self.causality == "input" or self.initial in ("exact", "approx")
        if needs_start and self.start is None:
            yield f"{self.name} needs a start value: {self.causality}, initial = {self.initial}"
        if not needs_start and self.start is not None:
            yield f"{self.name} has a start value, but is {self.causality} with initial = {self.initial}"

    def _initials(self) -> tuple[str, ...]:
        """Return the values that ``initial`` may have, the default first."""
        if self.causality in ("input", "independent"):
            return ()
        if self.causality == "parameter" or self.variability == "constant":
            return ("exact",)
        return _INITIAL_CALCULATED if self.variability in ("fixed", "tunable") else _INITIAL_ANY
