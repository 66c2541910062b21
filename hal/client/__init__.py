"""A robot at the other end of the bus."""
