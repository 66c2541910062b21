"""Verbs that keep what happened and look through it."""
