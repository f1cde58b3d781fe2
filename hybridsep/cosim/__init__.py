"""FMUs loaded with fmpy and stepped together."""
