"""Machines that were published by others: what compensation is worth on plants whose equations are not ours."""
