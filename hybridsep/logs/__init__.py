"""Recorded logs of an axis."""
