"""The same script of motions on two robots, and where they differ."""
