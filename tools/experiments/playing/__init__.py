"""Trials are played side by side, and what came of them is kept by what it depends on."""
