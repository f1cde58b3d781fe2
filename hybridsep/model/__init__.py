"""Physics-based linear model of a drive, eqs. (2) and (15)."""
