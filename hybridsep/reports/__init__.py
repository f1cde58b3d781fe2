"""Reports of a replay: advice, charts by section, use of the FMU, step times."""
