"""Identification of ``G_pb`` from operation in closed loop."""
