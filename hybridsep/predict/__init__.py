"""Linear hybrid predictor, eqs. (2) to (6): by windows and sample by sample."""
