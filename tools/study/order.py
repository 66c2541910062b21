"""Who does what in which order, and under which name: balanced Latin squares (Williams 1949). Pure."""

import random
from collections.abc import Sequence


def square(count: int) -> list[list[int]]:
    """Rows in which everything is at every place equally often, and follows everything else equally often.

    As many rows as things if their number is even, else twice as many.
    """
    first, low, high = [0], 1, count - 1
    while len(first) < count:
        first.append(low if len(first) % 2 else high)
        low, high = (low + 1, high) if len(first) % 2 == 0 else (low, high - 1)
    rows = [[(place + shift) % count for place in first] for shift in range(count)]
    return rows if count % 2 == 0 else rows + [row[::-1] for row in rows]


def order(methods: Sequence[str], participant: int) -> list[str]:
    """The methods in the order of one participant, counting from 1."""
    rows = square(len(methods))
    return [methods[index] for index in rows[(participant - 1) % len(rows)]]


def blinded(methods: Sequence[str], participant: int, seed: int) -> dict[str, str]:
    """What each method is called on one participant's screen: letters that tell neither the method nor its place."""
    letters = [chr(ord("A") + index) for index in range(len(methods))]
    random.Random(f"{seed}/{participant}").shuffle(letters)
    return dict(zip(methods, letters, strict=True))
