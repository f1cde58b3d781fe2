"""Recorded logs of an axis: commanded and measured positions at a fixed sampling interval."""
