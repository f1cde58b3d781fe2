"""Live view: the native core on samples as they come, with a local page and PlotJuggler as its readers."""
