"""Trusted model of the residual: candidates shrunk by their variance, their blend, and the guard of what they learn."""
