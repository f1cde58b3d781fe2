"""Intake of recorded logs: what may be wrong with one, in words and numbers, and how it is put right."""
