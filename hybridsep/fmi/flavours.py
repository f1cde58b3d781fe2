"""Flavours of FMUs, and versions of FMI that they are written for."""

FLAVOURS = ("native", "python")  # the default first
FMI_VERSIONS = ("2", "3")  # FMI 2.0 and FMI 3.0; the default first
