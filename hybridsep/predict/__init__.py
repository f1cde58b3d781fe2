"""Hybrid predictor by windows, eqs. (2) to (6): what its two models of the residual share."""
