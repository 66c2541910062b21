"""Verbs that put a robot on the bus, and compare and measure robots."""
