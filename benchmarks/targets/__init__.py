"""Sizes, stack and instructions of the C library on processors of controllers."""
