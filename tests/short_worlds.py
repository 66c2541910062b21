"""A world for tests that drive a whole lap: a straight line with one box on it."""

FEW_METRES = """
description = "A few metres of straight line with one box on it"

[line]
pieces = [{ straight_m = 14.0 }]

[[box]]
x_m = 5.0
y_m = 0.0

[limits]
finish_m = 8.0
lost_m = 1.5
"""
