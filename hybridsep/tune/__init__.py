"""Choice of a predictor's settings by causal replays of recordings."""
