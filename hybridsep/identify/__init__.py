"""Identification of ``G_pb``: from operation in closed loop, from a frequency response, from a swept sine."""
