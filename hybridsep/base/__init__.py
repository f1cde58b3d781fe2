"""Foundations without control engineering: errors, parameters, signals, files, states, time."""
