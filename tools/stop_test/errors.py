"""What the stop test has to say when it cannot tell."""

from lira.hal.errors import LiraError


class StopTestError(LiraError):
    """What is under test did not do what has to come before a fault, or with it."""
