"""Servo error pre-compensation: modified commands planned on the hybrid model."""
