"""Command line and demonstration."""
