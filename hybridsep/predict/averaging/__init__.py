"""Trusted model of the residual: experts shrunk by their variance, their stack, and which samples are believed."""
