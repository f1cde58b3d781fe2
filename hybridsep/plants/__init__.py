"""Simulated drives, encoders and trajectories."""
