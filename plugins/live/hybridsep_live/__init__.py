"""Live view: the native predictor on samples as they come, with a local page and PlotJuggler as its readers."""
