"""A deployment over a real sshd on the loopback: with a key, a port and a home folder of its own."""

import getpass
import os
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from lira.hal.errors import LiraError
from lira.tools.cli import main
from lira.tools.deploy.target import Target
from lira.tools.launch.processes import ChildProcess, free_port

WORDS = ["--", "--base", "/dev/core2", "--without", "lidar", "--without", "camera"]
TIMEOUT_S = 120
INFO = "lira_rosbot-9.9.dist-info"


def program(name):
    found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin")
    if found is None:
        pytest.skip(f"no {name} is installed (Debian's openssh-server and openssh-client)")
    return found


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    """A robot's computer: `config` is for ssh, `home` its user's folder, `asked` what systemd was asked there."""
    sshd, keygen = program("sshd"), program("ssh-keygen")
    program("ssh")
    folder = tmp_path_factory.mktemp("far")
    home, programs, port = folder / "home", folder / "bin", free_port()
    home.mkdir()
    programs.mkdir()
    for name in ("systemctl", "loginctl"):
        version = '[ "$1" = --version ] && echo "systemd 255 (255.4)" && exit'
        (programs / name).write_text(f'#!/bin/sh\n{version}\necho {name} "$@" >> {folder}/asked\n')
        (programs / name).chmod(0o755)
    for key in ("host_key", "key"):
        subprocess.run([keygen, "-q", "-t", "ed25519", "-N", "", "-f", folder / key], check=True, timeout=TIMEOUT_S)
    shutil.copy(folder / "key.pub", folder / "authorized")
    python = Path(sys.executable).resolve().parent
    (folder / "shell").write_text(
        f'#!/bin/sh\nexport HOME={home} PATH={programs}:{python}:$PATH\nexec sh -c "$SSH_ORIGINAL_COMMAND"\n'
    )
    (folder / "shell").chmod(0o755)
    (folder / "sshd_config").write_text(
        f"Port {port}\nListenAddress 127.0.0.1\nHostKey {folder}/host_key\nAuthorizedKeysFile {folder}/authorized\n"
        f"PidFile none\nUsePAM no\nStrictModes no\nPasswordAuthentication no\nForceCommand {folder}/shell\n"
    )
    (folder / "config").write_text(
        f"Host robot\n HostName 127.0.0.1\n Port {port}\n User {getpass.getuser()}\n IdentityFile {folder}/key\n"
        f" IdentitiesOnly yes\n StrictHostKeyChecking no\n UserKnownHostsFile {folder}/known\n LogLevel ERROR\n"
    )
    if os.getuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)  # where sshd locks itself up
    with ChildProcess("sshd", [sshd, "-D", "-e", "-f", str(folder / "sshd_config")], folder / "sshd.log") as child:
        child.wait_ready("Server listening", 30.0)
        yield folder


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """A folder with a wheel that is called as ours is, needs nothing, and has but a command."""
    folder = tmp_path_factory.mktemp("wheels")
    files = {
        "lira/__init__.py": "",
        "lira/tools/__init__.py": "",
        "lira/tools/__main__.py": "print('the lira that was deployed')\n",
        f"{INFO}/METADATA": "Metadata-Version: 2.1\nName: lira-rosbot\nVersion: 9.9\n"
        "Provides-Extra: robot\nProvides-Extra: drive\n",
        f"{INFO}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{INFO}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{INFO}/RECORD"])
    with zipfile.ZipFile(folder / "lira_rosbot-9.9-py3-none-any.whl", "w") as wheel:
        for name, text in files.items():
            wheel.writestr(name, text)
    return folder


def deploy(far, *words):
    return main(["deploy", "robot", "--host", "robot", "--ssh-config", str(far / "config"), *words])


def files_of(home):
    """Where deployments write; programs that are started there may leave more in a home folder."""
    return [path for name in (".config", ".local") for path in (home / name).rglob("*") if path.is_file()]


def test_a_robot_is_deployed_runs_what_came_and_is_left_as_it_was(far, wheels, capsys):
    home, asked = far / "home", far / "asked"
    words = ["--wheels", str(wheels), "--offline"]
    assert deploy(far, "--dry-run", *words, *WORDS) == 0
    assert "on robot, in the home folder of its user" in capsys.readouterr().out
    assert files_of(home) == []

    assert deploy(far, *words, *WORDS) == 0
    assert "lira-rosbot.target is started" in capsys.readouterr().out
    unit = (home / ".config" / "systemd" / "user" / "lira-rosbot-robot.service").read_text()
    command = next(line for line in unit.splitlines() if line.startswith("ExecStart="))
    python = home / ".local" / "share" / "lira" / "rosbot" / "venv" / "bin" / "python"
    assert command.startswith(f"ExecStart={python} -m lira.tools robot --base /dev/core2 --without lidar")
    done = subprocess.run(
        [python, "-m", "lira.tools"], check=True, capture_output=True, text=True, timeout=TIMEOUT_S, cwd=home
    )
    assert done.stdout == "the lira that was deployed\n"
    assert "systemctl --user restart lira-rosbot.target" in asked.read_text().splitlines()

    assert deploy(far, *words, *WORDS) == 0  # again, over what is there
    assert deploy(far, "--remove") == 0
    assert "'rosbot' is removed" in capsys.readouterr().out
    assert files_of(home) == []


def test_what_fails_there_is_told_here(far, capsys):
    target = Target("robot", far / "config")
    with pytest.raises(LiraError, match="robot: no room"):
        target.run("echo no room >&2; exit 3")
    assert target.run('cat; echo "$1"', "it's; $HOME", data=b"input ") == "input it's; $HOME"


def test_a_key_that_is_not_let_in_is_an_error_with_a_remedy(far, tmp_path, capsys):
    config = (far / "config").read_text().replace(f"{far}/key", str(tmp_path / "other"))
    subprocess.run([program("ssh-keygen"), "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / "other"], check=True)
    (tmp_path / "config").write_text(config)
    began_s = time.monotonic()
    assert main(["deploy", "robot", "--host", "robot", "--ssh-config", str(tmp_path / "config"), "--remove"]) == 2
    assert "ssh-copy-id" in capsys.readouterr().err
    assert time.monotonic() - began_s < 60.0
