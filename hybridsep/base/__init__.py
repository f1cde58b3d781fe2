"""Foundations: errors, parameters, settings, signals, files, saved states, time."""
