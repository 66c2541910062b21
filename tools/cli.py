"""The `lira` command: finds the verb, runs it, and tells in two lines what went wrong."""

import argparse
import importlib
import re
import signal
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING, NoReturn, Protocol, cast

from lira.hal.errors import ConfigError, LiraError, MissingExtraError, did_you_mean
from lira.hal.plugins import blame
from lira.tools.launch import lifetime
from lira.tools.verbs import GROUPS, VERBS, Verb

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


# Packages that only a part of the installation has, and the extra that brings them.
EXTRAS = {
    "pybullet": "sim",
    "serial": "robot",
    "openni": "robot",
    "av": "video",
    "joblib": "experiment",
    "matplotlib": "experiment",
    "tqdm": "experiment",
    "distributed": "experiment",
    "aiohttp": "web",
    "segno": "web",
    "torch": "learn",
    "safetensors": "drive",
    "threadpoolctl": "drive",
    "pygame": "console",
    "cryptography": "keys",
    "mcap": "record",
    "zstandard": "record",
    "foxglove": "view",
    "h5py": "export",
    "pyarrow": "export",
    "rerun": "rerun",
    "prometheus_client": "view",
    "onnx": "onnx",
}

LIKE = 0.75  # how much of an option has to be right
EXIT_ERROR = 2
EXIT_BROKEN_PIPE = lifetime.EXIT_SIGNAL + signal.SIGPIPE


class VerbModule(Protocol):
    """What a verb's module offers."""

    __doc__: str | None

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the verb's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Do the work and return the exit status."""


class Parser(argparse.ArgumentParser):
    """A parser that tells its errors as all are told, and does not keep to itself that its help cannot be written."""

    def error(self, message: str) -> NoReturn:
        """Raise `ConfigError` for words that make no sense, with the option or the choice that may have been meant."""
        unknown = re.search(r"unrecognized arguments: (-[^\s=]+)", message)
        meant = did_you_mean(unknown[1], re.findall(r"--[\w-]+", self.format_help()), LIKE) if unknown else ""
        if chosen := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
            meant = did_you_mean(chosen[1], re.findall(r"[\w.-]+", chosen[2]))
        raise ConfigError(message, f"{meant} `{self.prog} --help` explains its words.".lstrip())

    def _print_message(self, message: str, file: "SupportsWrite[str] | None" = None) -> None:
        (file or sys.stderr).write(message)


def main(arguments: list[str] | None = None) -> int:
    """Run `lira` with `arguments` (default: the command line's) and return its exit status.

    0: done. 1: done, but the answer is no (a demo that did not converge). 2: an error that the user can mend.
    130, 143: ended by Ctrl-C or a kill. 141: whoever read the output has gone.
    """
    words = sys.argv[1:] if arguments is None else arguments
    prefix = f"lira {words[0]}" if words and words[0] in VERBS else "lira"
    try:
        lifetime.claim_descriptors()
        with lifetime.interruptible(), lifetime.heard():
            try:
                return dispatch(words, prefix)
            finally:
                sys.stdout.flush()  # a reader that has gone shows here, not at exit
    except KeyboardInterrupt as interrupt:
        return lifetime.EXIT_SIGNAL + getattr(interrupt, "number", signal.SIGINT)
    except BrokenPipeError:
        lifetime.abandon_output()
        return EXIT_BROKEN_PIPE
    except Exception as error:
        told = told_of(error)
        if told is None:
            raise
        return complain(prefix, told)


def told_of(error: Exception) -> LiraError | None:
    """Return what to tell the user about an error: what they can mend; None for a fault of the project's own."""
    if isinstance(error, LiraError):
        return error
    if isinstance(error, ModuleNotFoundError):
        missing = str(error.name)
        extra = EXTRAS.get(missing.split(".")[0])
        return blame(error) if extra is None else MissingExtraError(missing, extra)
    if isinstance(error, OSError) and lifetime.is_unwritable(error):
        lifetime.abandon_output()
        return lifetime.unwritable(error)
    scarce = lifetime.out_of_memory(error) if isinstance(error, MemoryError | RuntimeError | ImportError) else None
    return scarce or blame(error)


def require(*packages: str) -> None:
    """Refuse to begin where one of these is not installed. Raises `MissingExtraError`."""
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(package, EXTRAS[package])


def entry() -> NoReturn:
    """Be the `lira` command: run it and end the process."""
    lifetime.process(main)


def dispatch(words: list[str], program: str) -> int:
    """Run what the words ask for. `SystemExit` (of a verb's help) passes through."""
    if not words or words[0] in ("-h", "--help"):
        print(overview())
        return 0
    if words[0] == "--version":
        print(f"lira {version()}")
        return 0
    module = cast(VerbModule, importlib.import_module(find_verb(words[0]).module))
    description, _, examples = (module.__doc__ or "").partition("\n\n")
    parser = Parser(
        prog=program,
        description=description,
        epilog=examples.rstrip(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    return module.run(parser.parse_args(words[1:]))


def complain(program: str, error: LiraError) -> int:
    """Print one line for what is wrong and one for the remedy."""
    print(f"{program}: {error.what}", file=sys.stderr)
    if error.remedy:
        print(f"  {error.remedy}", file=sys.stderr)
    return EXIT_ERROR


def find_verb(name: str) -> Verb:
    """Look a verb up. Raises `ConfigError` that names the nearest one."""
    if name in VERBS:
        return VERBS[name]
    meant = did_you_mean(name, VERBS, 0.5)
    raise ConfigError(f"unknown verb '{name}'", f"{meant} Verbs: {', '.join(VERBS)}.".lstrip())


def overview() -> str:
    """Text of `lira --help`."""
    width = max(map(len, VERBS))
    lines = []
    for (_, title), verbs in GROUPS.items():
        lines += ["", f"{title}:", *(f"  {name:<{width}}  {help_}" for name, help_ in verbs.items())]
    return "\n".join(
        [
            "usage: lira VERB [arguments]",
            "",
            "Teach a ROSbot by interaction: single-sensor experts and a person train a fused policy (LIRA-SPF).",
            *lines,
            "",
            "`lira VERB --help` explains a verb; `lira --version` names the version. Start with `lira demo`.",
        ]
    )


def version() -> str:
    """Return the installed version."""
    from importlib.metadata import version as installed

    return installed("lira-rosbot")
