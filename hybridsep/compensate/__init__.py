"""Servo error pre-compensation: commands planned on the hybrid prediction."""
