"""Report of figures beside their limits."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["Report"]


@dataclass
class Report:
    """Prints figures beside their limits and remembers those that are missed."""

    missed: list[str] = field(default_factory=list)

    def title(self, text: str) -> None:
        """Begin a table."""
        print(f"\n{text}")

    def line(self, name: str, figure: float, limit: str = "", held: bool = True, note: str = "") -> None:
        """Print a figure; remember it if its limit is not held."""
        verdict = "" if not limit else "ok" if held else "MISSED"
        print(f"  {name:<52}{figure:9.2f}  {limit:<18}{verdict:<8}{note}")
        if not held:
            self.missed.append(f"{name}: {figure:.2f} µm, {limit}")

    def most(self, name: str, figure: float, limit: float, note: str = "") -> None:
        """Print a figure that must not exceed its limit."""
        self.line(name, figure, f"at most {limit:.2f}", figure <= limit, note)
