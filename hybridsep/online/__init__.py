"""Predictor and compensator sample by sample, as in an FMU."""
