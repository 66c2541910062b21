"""Verbs that learn, drive with what was learned, and experiment."""
