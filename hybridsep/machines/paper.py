"""The paper's own settings of the predictor, with which its figures are made.

By default the bundled machines, as every machine, have ``averaging = true`` instead: online model averaging.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..base.errors import MachineError
from .machine import Machine, load_machine

__all__ = ["PAPER_SETTINGS", "paper_machine"]

PAPER_SETTINGS: Mapping[str, Mapping[str, bool | float]] = {
    "spring_mass_damper": {"averaging": False, "t_init": 0.3},
    "als25010_x": {"averaging": False, "t_init": 0.297},
    "als25010_y": {"averaging": False, "t_init": 0.297},
    "emps": {"averaging": False, "t_init": 1.242},
}
"""By machine: the residual model of eqs. (5) and (6) as printed, and a warm-up, s, of 5 % of the trajectory."""


def paper_machine(name: str) -> Machine:
    """Return a bundled machine whose predictor has the paper's settings.

    Parameters
    ----------
    name : str
        Of :data:`PAPER_SETTINGS`.

    Raises
    ------
    MachineError
        If the paper has no settings for it.
    """
    if name not in PAPER_SETTINGS:
        raise MachineError(f"the paper's machines are {', '.join(PAPER_SETTINGS)}, got {name!r}")
    return load_machine(name).changed("predictor", PAPER_SETTINGS[name])
