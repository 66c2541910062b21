"""One tree of errors. Each says what is wrong and what to do about it; the `lira` command prints both."""

from collections.abc import Iterable


class LiraError(Exception):
    """Root of everything this project raises on purpose.

    `remedy` is one sentence that tells the reader what to do next.
    """

    def __init__(self, what: str, remedy: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.what}. {self.remedy}" if self.remedy else self.what


class ConfigError(LiraError):
    """A profile, world, preset or flag that is unknown, malformed or out of range."""


class BusError(LiraError):
    """The bus cannot be opened, a peer does not answer, or a name is already taken."""


class CodecError(LiraError):
    """Bytes that are not the message they claim to be."""


class SensorError(LiraError):
    """A reading that cannot be used: wrong length, truncated image, wrong type."""


class DeviceError(LiraError):
    """A device is missing, wrong or lost."""


class StorageError(LiraError):
    """A log or checkpoint that is corrupt, or a disk that does not take it."""


class PluginError(LiraError):
    """What somebody brought along (an expert, a method, a robot, an experiment) does not do what it should."""


class MissingExtraError(LiraError):
    """A verb needs an optional part of the installation that is not there."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"{package} is not installed", f"Install it with: pip install 'lira-rosbot[{extra}]'")


def did_you_mean(word: str, known: Iterable[str], alike: float = 0.6) -> str:
    """Return the question whether the nearest of the known words was meant, empty if none is as much `alike`."""
    import difflib  # whoever is understood need not wait for it

    near = difflib.get_close_matches(word, known, n=1, cutoff=alike)
    return f"Did you mean `{near[0]}`?" if near else ""
