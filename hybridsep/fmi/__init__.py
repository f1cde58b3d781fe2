"""FMUs, each from one variable table: modelDescription, slave and documentation."""
