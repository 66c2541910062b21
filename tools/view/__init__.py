"""Viewers of others: Foxglove, Rerun and Prometheus see what is on the bus.

They look and nothing else: no message of theirs gets to the robot. `source.py` says where samples come from,
`stream.py` hands them on, and each viewer is a module.
"""
