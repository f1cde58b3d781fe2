"""Trusted model of the residual: experts shrunk by their variance, their stack, and the guard of what they learn."""
