"""FMUs, each from one variable table: modelDescription, slave and documentation."""

FLAVOURS = ("native", "python")  # of FMUs; the default first
FMI_VERSIONS = ("2", "3")  # FMI 2.0 and FMI 3.0; the default first
