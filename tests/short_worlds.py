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

# The same in half of that, for what drives it in real time.
FEWER_METRES = FEW_METRES.replace("x_m = 5.0", "x_m = 2.5").replace("finish_m = 8.0", "finish_m = 4.5")
