"""What a deployment writes and runs, as a value that can be shown before anything is done. Pure."""

import io
import shlex
import tarfile
from dataclasses import dataclass

from lira.tools.lifecycle.services import config_folder, target_name, unit_name

SECRET = 0o600
PLAIN = 0o644
MOST_SHOWN = 2000


def manifest_of(name: str) -> str:
    """Where it is written down what was put there, a path a line; a folder ends with a slash."""
    return f"{config_folder(name)}/deployed"


@dataclass(frozen=True, slots=True)
class File:
    """One file, below the home folder of whoever it is for. What only that user may read is not shown."""

    path: str
    data: bytes
    mode: int = PLAIN

    def shown(self) -> str:
        """The file for a person: its text, or how much it is; one without data is made when it is deployed."""
        if not self.data:
            return f"--- ~/{self.path} ({self.mode:o}, built from this checkout when it is deployed)"
        head = f"--- ~/{self.path} ({self.mode:o}, {len(self.data)} bytes)"
        if self.mode == SECRET or len(self.data) > MOST_SHOWN:
            return head
        try:
            text = self.data.decode()
        except UnicodeDecodeError:
            return head
        return f"{head}\n{text.rstrip()}"


@dataclass(frozen=True, slots=True)
class Plan:
    """Files, then what is run there. `processes` are those that get a unit; `folders` are made there, and go with it.

    `install` are lines of the shell that come before the units are started. `notes` is what a person has to do.
    """

    name: str
    processes: tuple[str, ...]
    files: tuple[File, ...]
    install: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def manifest(self) -> str:
        """Where it is written down what was put there."""
        return manifest_of(self.name)

    def archive(self) -> bytes:
        """All files with the list of them, as a tar archive."""
        buffer = io.BytesIO()
        listed = "".join(f"{path}\n" for path in [*(file.path for file in self.files), *self.folders])
        with tarfile.open(fileobj=buffer, mode="w") as archive:
            for file in [*self.files, File(self.manifest, listed.encode())]:
                member = tarfile.TarInfo(file.path)
                member.size, member.mode = len(file.data), file.mode
                archive.addfile(member, io.BytesIO(file.data))
        return buffer.getvalue()

    def stale(self, before: list[str]) -> list[str]:
        """What an earlier deployment put there and this one does not."""
        now = {*(file.path for file in self.files), *self.folders}
        return [path for path in before if path not in now and _is_inside(path)]

    def script(self, before: list[str]) -> str:
        """What is run there, with the archive as its input; `before` is the list of an earlier deployment."""
        stale = self.stale(before)
        units = [path.rpartition("/")[2] for path in stale if path.endswith((".service", ".target"))]
        lines = ["set -eu", 'cd "$HOME"', "umask 077"]
        if units:
            lines.append(f"systemctl --user disable --now {shlex.join(units)} >/dev/null 2>&1 || true")
        lines += [f"rm -rf -- {shlex.quote(path)}" for path in stale]
        lines += ["tar -xpf -", *self.install, *self.start()]
        return "\n".join(lines)

    def start(self) -> list[str]:
        """Lines that have systemd take it over, and go on without a login."""
        wanted = shlex.join([target_name(self.name), *(unit_name(self.name, each) for each in self.processes)])
        return [
            "if systemctl --user show-environment >/dev/null 2>&1; then",
            "  systemctl --user daemon-reload",
            f"  systemctl --user enable --quiet {wanted}",
            f"  systemctl --user restart {target_name(self.name)}",
            '  loginctl enable-linger "$(id -un)" || echo "it ends when you log out: loginctl was refused"',
            f'  echo "{target_name(self.name)} is started"',
            "else",
            '  echo "no systemd answers this user here: the units are written, and nothing is started"',
            "fi",
        ]

    def shown(self, before: list[str]) -> str:
        """All of it for a person."""
        blocks = [
            *(file.shown() for file in self.files),
            f"--- by this script, which unpacks them\n{self.script(before)}",
        ]
        if self.notes:
            blocks.append("\n".join(["--- yourself, once", *self.notes]))
        return "\n\n".join(blocks)


def _is_inside(path: str) -> bool:
    """Whether a path of a list that is read back stays below the home folder."""
    return bool(path) and not path.startswith("/") and ".." not in path.split("/")


def removal(name: str) -> str:
    """What is run to undo a deployment: by its own list, and nothing outside the home folder."""
    manifest, settings = shlex.quote(manifest_of(name)), config_folder(name)
    return f"""set -eu
cd "$HOME"
[ -f {manifest} ] || {{ echo "nothing was deployed for '{name}' there"; exit 0; }}
systemctl --user disable --now {target_name(name)} >/dev/null 2>&1 || true
while IFS= read -r path; do
  case "$path" in
    /*|../*|*/../*|*/..|'') ;;
    *.service) systemctl --user disable --now "${{path##*/}}" >/dev/null 2>&1 || true; rm -f -- "$path" ;;
    */) rm -rf -- "$path" ;;
    *) rm -f -- "$path" ;;
  esac
done < {manifest}
rm -f -- {manifest}
for folder in {settings}/keys {settings} .local/share/lira/{name}/wheels .local/share/lira/{name}; do
  rmdir -- "$folder" 2>/dev/null || true
done
systemctl --user daemon-reload >/dev/null 2>&1 || true
echo "'{name}' is removed"
"""
