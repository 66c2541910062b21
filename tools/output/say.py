"""How a verb says a line."""


def say(line: str) -> None:
    """Print a line at once, whoever hears it through a pipe."""
    print(line, flush=True)
