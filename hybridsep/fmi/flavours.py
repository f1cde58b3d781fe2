"""Flavours of FMUs, and versions of FMI that they are written for."""

from ..base.errors import FmuError

FLAVOURS = ("native", "python")  # the default first
FMI_VERSIONS = ("2", "3")  # FMI 2.0 and FMI 3.0; the default first


def check_version(flavour: str, fmi: str) -> None:
    """Raise FmuError if the flavour has no FMUs of this version of FMI, or if there is no such version."""
    if fmi not in FMI_VERSIONS:
        raise FmuError(f"the version of FMI must be one of {', '.join(FMI_VERSIONS)}, got {fmi!r}")
    if flavour == "python" and fmi != "2":
        raise FmuError(f"FMUs of the Python flavour are of FMI 2 alone, as pythonfmu's are, got FMI {fmi}")
