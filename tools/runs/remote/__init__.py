"""Runs with a robot over the bus: a policy alone, a script on a twin, a person; and what such a run reaches there."""
