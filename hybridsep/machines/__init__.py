"""Machines: description of one axis in a TOML file, for the library, the FMUs and the command line."""
