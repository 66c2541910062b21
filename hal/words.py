"""Numbers and their nouns, in messages."""


def plural(count: int, noun: str) -> str:
    """Return so many of something: 1 lap, 2 laps."""
    ending = "" if count == 1 else "es" if noun.endswith(("x", "s", "ch", "sh")) else "s"
    return f"{count} {noun}{ending}"
