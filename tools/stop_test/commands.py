"""The commands that start the processes under test."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.bus.security.keys import VARIABLE as KEYS_VARIABLE
from lira.tools.stop_test.mutants import Mutant
from lira.tools.stop_test.parts import launch
from lira.tools.stop_test.setups import Setup, clock_library

if TYPE_CHECKING:
    from lira.tools.stop_test.keyring import Keyring

POLICY, HAND, ROBOT, WORLD = "policy", "hand", "robot", "world"


class Commands:
    """Makes them with what is peculiar to the setup, the keys, the mutant and the journal."""

    def __init__(
        self, folder: Path, journal: Path, setup: Setup, keyring: "Keyring | None", mutant: Mutant | None
    ) -> None:
        self._folder, self._journal, self._setup = folder, journal, setup
        self._keyring, self._mutant = keyring, mutant

    def start(self, role: str, module: str, words: list[str], certificate: str, noted: str | None) -> list[str]:
        """Command that starts a module in a role. A commander shows a certificate; `noted` notes what it sends."""
        options = [] if noted is None else ["--note", str(self._journal), noted]
        if self._mutant is not None and role in self._mutant.where:
            options += ["--mutant", self._mutant.name]
        if self._setup.clocks:
            options.append("--shifted")
        head = [*self._environment(role, certificate), sys.executable, "-m", launch.__name__]
        return [*head, *options, module, *words]

    def clock_file(self, role: str) -> Path:
        """What tells a process how far its time of day is off."""
        return self._folder / f"{role}.clock"

    def _environment(self, role: str, certificate: str) -> list[str]:
        """Words that start a command with what is peculiar to the setup."""
        settings = {}
        if self._keyring is not None:
            settings[KEYS_VARIABLE] = str(self._keyring.prepare(ROBOT if role == ROBOT else certificate))
        if self._setup.clocks:
            self.clock_file(role).write_text("+0", encoding="utf-8")
            settings["LD_PRELOAD"] = str(clock_library())
            settings["FAKETIME_TIMESTAMP_FILE"] = str(self.clock_file(role))
            settings["FAKETIME_CACHE_DURATION"] = "1"
            settings["FAKETIME_DONT_FAKE_MONOTONIC"] = "1"
        return ["env", *(f"{name}={value}" for name, value in settings.items())] if settings else []
