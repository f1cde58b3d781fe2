"""Simulated drives, their encoders and the trajectories that they follow."""
