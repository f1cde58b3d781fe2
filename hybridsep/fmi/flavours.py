"""Flavours of FMUs, and versions of FMI that they are written for."""

from __future__ import annotations

from ..base.errors import FmuError, ParameterError

__all__ = ["FLAVOURS", "FMI_CHOICES", "FMI_VERSIONS", "check_version", "versions_of"]

FLAVOURS = ("native", "python")
"""The default first."""

FMI_VERSIONS = ("2", "3")
"""FMI 2.0 and FMI 3.0; the default first."""

_BOTH = "both"
FMI_CHOICES = (*FMI_VERSIONS, _BOTH)
"""What ``--fmi`` takes."""


def versions_of(fmi: str, flavour: str) -> tuple[str, ...]:
    """Return the versions of FMI that one of :data:`FMI_CHOICES` asks for.

    Raises
    ------
    ParameterError
        If it is none of them, or one that the flavour has not.
    """
    if fmi not in FMI_CHOICES:
        raise ParameterError(f"--fmi must be one of {', '.join(FMI_CHOICES)}, got {fmi!r}")
    if flavour == "python" and fmi != FMI_VERSIONS[0]:
        raise ParameterError(f"--fmi {fmi} is for native FMUs, pythonfmu's are of FMI 2 alone; leave it out")
    return FMI_VERSIONS if fmi == _BOTH else (fmi,)


def check_version(flavour: str, fmi: str) -> None:
    """Raise FmuError if the flavour has no FMUs of this version of FMI, or if there is no such version."""
    if fmi not in FMI_VERSIONS:
        raise FmuError(f"the version of FMI must be one of {', '.join(FMI_VERSIONS)}, got {fmi!r}")
    if flavour == "python" and fmi != "2":
        raise FmuError(f"FMUs of the Python flavour are of FMI 2 alone, as pythonfmu's are, got FMI {fmi}")
