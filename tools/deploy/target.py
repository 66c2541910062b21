"""The machine that is deployed to: this one, or one that ssh reaches."""

import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from lira.hal.errors import ConfigError
from lira.tools.deploy.plan import Plan, manifest_of
from lira.tools.launch.processes import ProcessError

LOOK_S = 30.0
INSTALL_S = 1800.0  # packages come over somebody's network
CONNECT_S = 10
MARK = "--- lira ---"  # what a shell prints at its start comes before it
LOOK = f"""cd "$HOME"
echo '{MARK}'
pwd -P
systemctl --version 2>/dev/null | sed -n '1s/^systemd \\([0-9]*\\).*/\\1/p' | grep . || echo 0
"$2" -c 'import sys; print(*sys.version_info[:2])' 2>/dev/null || echo 0 0
cat "$1" 2>/dev/null || true
"""


USUAL_SYSTEMD = 255
USUAL_PYTHON = 3, 12


@dataclass(frozen=True, slots=True)
class Facts:
    """What matters of a machine: its user's home, the versions of its systemd (0: none) and Python, what was there."""

    home: str
    systemd: int
    python: tuple[int, ...]
    before: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The machine, for a person."""
        return f"{self.home}, systemd {self.systemd}, Python {'.'.join(map(str, self.python))}"


class Target:
    """Runs the shell on a machine: `host` as ssh takes it, None for this one. `config` is a file for ssh.

    What fails raises `ProcessError` with what it wrote.
    """

    def __init__(self, host: str | None = None, config: Path | None = None) -> None:
        if host is not None and (not host or host.startswith("-")):
            raise ConfigError(f"'{host}' is no host", "Write it as for ssh: user@robot.")
        self._host = host
        self._config = config

    @property
    def where(self) -> str:
        """The machine, for a person."""
        return self._host or "this machine"

    def look(self, name: str, python: str = "python3") -> Facts:
        """Find out what matters; nothing is changed."""
        _, _, told = self.run(LOOK, manifest_of(name), python, timeout_s=LOOK_S).partition(f"{MARK}\n")
        lines = told.splitlines()
        if len(lines) < 3 or not lines[1].isdecimal():
            raise ProcessError(
                f"{self.where} does not answer as a Unix machine does", "See what its shell prints first."
            )
        version = tuple(int(part) for part in lines[2].split())
        return Facts(lines[0], int(lines[1]), version, tuple(lines[3:]))

    def suppose(self, name: str) -> Facts:
        """What `look` would find on a usual machine, without asking it: for a plan that is only shown."""
        if self._host is not None:
            user, _, _ = self._host.rpartition("@")
            return Facts(f"/home/{user or 'USER'}", USUAL_SYSTEMD, USUAL_PYTHON)
        manifest = Path.home() / manifest_of(name)
        before = manifest.read_text(errors="replace").splitlines() if manifest.is_file() else ()
        return Facts(str(Path.home()), USUAL_SYSTEMD, USUAL_PYTHON, tuple(before))

    def put(self, plan: Plan, facts: Facts) -> str:
        """Do what a plan says, and return what was said there."""
        return self.run(plan.script(list(facts.before)), data=plan.archive())

    def run(self, script: str, *arguments: str, data: bytes = b"", timeout_s: float = INSTALL_S) -> str:
        """Run a script in `sh` there, with `data` as its input, and return what it printed."""
        words = ["sh", "-c", script, "sh", *arguments]
        command = words if self._host is None else [*self._ssh(), "--", self._host, shlex.join(words)]
        try:
            done = subprocess.run(command, input=data, capture_output=True, timeout=timeout_s, check=False)
        except FileNotFoundError as error:
            remedy = "Install openssh-client." if self._host else "Is it in PATH?"
            raise ProcessError(f"there is no {command[0]} here", remedy) from error
        except subprocess.TimeoutExpired as error:
            raise ProcessError(f"{self.where} has not answered for {timeout_s:.0f} s", "Try again.") from error
        if done.returncode:
            said = (done.stderr or done.stdout).decode(errors="replace").strip()
            remedy = "Try: ssh-copy-id and ssh to it; a password is not asked for." if done.returncode == 255 else ""
            raise ProcessError(f"{self.where}: {said or f'status {done.returncode}'}", remedy)
        return done.stdout.decode(errors="replace").strip()

    def _ssh(self) -> list[str]:
        config = [] if self._config is None else ["-F", str(self._config)]
        return ["ssh", *config, "-T", "-o", "BatchMode=yes", "-o", f"ConnectTimeout={CONNECT_S}"]
