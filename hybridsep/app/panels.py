"""Help of a command: its options by panels, and examples."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand

from ..base.settings import DRIVE_LIMIT_ENTRIES
from .options import COMPENSATOR_ENTRIES, KNOWN_ENTRIES, PREDICTOR_ENTRIES

__all__ = ["EXAMPLES", "PanelledCommand"]

_READING = ("unit", "T_s", "axis", "t", "x_d", "x", "delay", "resample", "list_channels")
_OUTPUT = ("out", "figure", "save", "fmus", "reports", "full", "force", "as_json")

_PANELS = {
    **dict.fromkeys(PREDICTOR_ENTRIES, "Parameters of the predictor"),
    **dict.fromkeys(COMPENSATOR_ENTRIES, "Parameters of the compensator"),
    **dict.fromkeys(KNOWN_ENTRIES, "What is known of the axis"),
    **dict.fromkeys(DRIVE_LIMIT_ENTRIES, "Limits of the drive, for a compensator"),
    **dict.fromkeys(_READING, "Reading the file"),
    **dict.fromkeys(_OUTPUT, "Output"),
}
"""Panel of an option by its name; the others are the command's own, the first."""

_KNOWN_OF_A_REPLAY = ("backtest", "report", "cosim", "tune")
"""Commands that take all parameters of the predictor, also the entries that are known of an axis."""

EXAMPLES = {
    "fit": (
        "hybridsep fit my_axis.csv --Np 100",
        "hybridsep fit my_axis.csv --unit mm --v_max 0.25 --a_max 20 --j_max 1e4",
    ),
    "identify": (
        "hybridsep identify my_axis.csv --out machine.toml",
        "hybridsep identify my_axis.csv --unit-gain --figure identified.png",
    ),
    "tune": (
        "hybridsep tune my_axis.csv -m my_axis/machine.toml",
        "hybridsep tune my_axis.csv -m my_axis/machine.toml --p 10,50",
    ),
    "init": ("hybridsep init machine.toml", "hybridsep init machine.toml --f_n 42 --zeta 0.35"),
    "demo": ("hybridsep demo --out demo", "hybridsep demo --out demo --force"),
    "build": (
        "hybridsep build -m my_axis/machine.toml --out dist",
        "hybridsep build HybridPredictor_my_axis -m my_axis/machine.toml --weights my_axis/trained.state",
    ),
    "cosim": (
        "hybridsep cosim -m my_axis/machine.toml --compensate hybrid",
        "hybridsep cosim --trajectory moves.csv --compensate off --figure run.png",
    ),
    "system": (
        "hybridsep system -m my_axis/machine.toml --compensate hybrid",
        "hybridsep system --ssp 2 --target host",
    ),
    "backtest": (
        "hybridsep backtest my_axis.csv -m my_axis/machine.toml",
        "hybridsep backtest my_axis.csv -m my_axis/machine.toml --figure errors.png --save trained.state",
    ),
    "report": (
        "hybridsep report my_axis.csv -m my_axis/machine.toml",
        "hybridsep report my_axis.csv -m my_axis/machine.toml --weights my_axis/trained.state --out today.html",
    ),
    "hal": ("hybridsep hal my_axis/machine.toml --out hal", "hybridsep hal x/machine.toml y/machine.toml --out hal"),
    "header": (
        "hybridsep header my_axis/machine.toml --predictor",
        "hybridsep header my_axis/machine.toml --predictor --weights my_axis/trained.state",
    ),
    "example-log": ("hybridsep example-log --out my_axis.csv", "hybridsep example-log --out my_axis.csv.gz"),
}
"""Two lines for each command."""


class PanelledCommand(TyperCommand):
    """Command whose help shows its options by panels."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        replays = self.name in _KNOWN_OF_A_REPLAY
        for one in self.params:
            panel = _PANELS.get(one.name or "")
            if panel and one.param_type_name == "option":
                if replays and one.name in KNOWN_ENTRIES:
                    panel = _PANELS["p"]
                if replays or one.name != "Np":  # the look-ahead of a fit is the controller's
                    one.rich_help_panel = panel  # type: ignore[attr-defined]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then options panel by panel."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for one in self.get_params(ctx):
            if record := one.get_help_record(ctx):
                panel = getattr(one, "rich_help_panel", None) or "Options"
                panels.setdefault("Arguments" if one.param_type_name == "argument" else panel, []).append(record)
        for name in sorted(panels, key=lambda name: (name != "Arguments", name != "Options", name == "Output")):
            with formatter.section(name):
                formatter.write_dl(panels[name])
