"""Co-simulation of a controller and a drive, FMUs or objects of the library."""
