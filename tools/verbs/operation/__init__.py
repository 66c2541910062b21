"""Verbs that set a robot up and keep it running."""
