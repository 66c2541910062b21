"""Worlds for tests that drive a whole lap: some metres of straight line with one box on it."""


def line_with_box(*, x_m: float, y_m: float = 0.0, finish_m: float, line_m: float = 14.0) -> str:
    """A world's text."""
    return f"""
description = "A few metres of straight line with one box on it"

[line]
pieces = [{{ straight_m = {line_m} }}]

[[box]]
x_m = {x_m}
y_m = {y_m}

[limits]
finish_m = {finish_m}
lost_m = 1.5
"""


FEW_METRES = line_with_box(x_m=5.0, finish_m=8.0)
FEWER_METRES = line_with_box(x_m=2.5, finish_m=4.5)  # for what drives it in real time
FOR_TRIALS = line_with_box(x_m=3.4, y_m=0.1, finish_m=5.8, line_m=9.0)
