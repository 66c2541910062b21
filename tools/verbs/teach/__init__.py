"""Verbs that teach a robot, from the demo to a study."""
