"""The linear hybrid predictor, eqs. (2) to (6), over logs and sample by sample."""
