"""The linear physics model of a drive, eqs. (2) and (15)."""
