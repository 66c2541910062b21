"""A reading that cannot be used."""

from lira.hal.errors import SensorError


class ReadingError(SensorError):
    """A reading that cannot be used; `reason` is the short name it is counted under."""

    def __init__(self, reason: str, what: str, remedy: str) -> None:
        super().__init__(what, remedy)
        self.reason = reason
