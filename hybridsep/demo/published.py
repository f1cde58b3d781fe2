"""Printed figures of the paper for the demonstration's cases."""

from __future__ import annotations

__all__ = ["PRINTED"]

PRINTED = {
    "staircase": {"rms_pb_um": 33.7, "rms_h_um": 14.7, "reduction_percent": 56.4},
    "spiral_x": {"rms_pb_um": 22.0, "rms_h_um": 13.7, "reduction_percent": 38.0},
    "spiral_y": {"rms_pb_um": 130.2, "rms_h_um": 94.5, "reduction_percent": 27.0},
    "emps": {},
}
"""RMS in µm against the measured position."""
