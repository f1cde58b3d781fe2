"""Columns of the samples, in the order of the sampler's pins in the HAL files. LinuxCNC's own Python reads this too."""

AXES = ("x", "y")

COLUMNS = (
    "n",
    *(axis + "_" + name for name in ("out", "delayed", "fb", "pos", "predicted", "state") for axis in AXES),
    "overruns",
)
"""A number; positions, mm, and the component's state; periods that began late so far."""
