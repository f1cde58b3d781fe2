"""Experiment: the residual as a few experts, stacked by their errors so far; beside the model with trust."""
