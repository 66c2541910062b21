"""What was on the bus, in files: recorded by a process of its own, read, repaired, played as a robot."""
