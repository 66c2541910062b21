"""Verbs for the person beside the robot: hand, eyes and ears."""
