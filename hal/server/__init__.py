"""Puts a robot on the bus."""
