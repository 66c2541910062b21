"""Experts by name, and the tasks they belong to."""
