"""This machine: Python, packages, processor, disk, load, clock, screen and sound."""

import ctypes
import importlib.util
import os
import platform
import shutil
import sys
import time
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from lira.hal.words import plural
from lira.tools.cli import EXTRAS
from lira.tools.doctor.finding import Finding, Patient, fail, ok, warn

OLDEST, NEWEST = (3, 11), (3, 14)
WHEELS = {"x86_64", "aarch64"}  # of processors for which every package has one
LIBC = (2, 28)  # that wheels are built for
BASE = ("zenoh", "msgspec", "numpy", "cv2", "rosbags", "ruamel.yaml")
TIGHT_BYTES, LITTLE_BYTES = 200e6, 2e9  # of disk
SMALL_BYTES = 400e6  # of memory
ASLEEP_S, NAPS = 0.002, 200
STALL_S = 0.05  # a quarter of a stop's time budget
STA_UNSYNC = 0x40
TIME_ERROR = 5


def python(_: Patient) -> Finding:
    """Which Python."""
    here = sys.version_info[:2]
    words = f"Python {platform.python_version()}"
    if here < OLDEST:
        return fail(words, f"Install Python {OLDEST[0]}.{OLDEST[1]} or newer.", version=platform.python_version())
    if here > NEWEST:
        remedy = f"Use {NEWEST[0]}.{NEWEST[1]} if a package has no wheel."
        return warn(f"{words}, newer than any that was tried", remedy, version=platform.python_version())
    return ok(words, version=platform.python_version())


def processor(_: Patient) -> Finding:
    """Whether packages have wheels for this processor and C library."""
    machine, bits = platform.machine(), 8 * ctypes.sizeof(ctypes.c_void_p)
    words = f"{machine}, {bits} bits, {platform.system()} {platform.release()}"
    if bits < 64:
        remedy = "Let it serve its serial ports, and run lira robot elsewhere: see robot/README.md, 32-bit ARM."
        return fail(f"{words}: numpy, OpenCV and others have no wheels for it", remedy, machine=machine, bits=bits)
    if sys.platform != "linux":
        remedy = "Use Linux for lira robot and lira joystick; console, twin and learner may work."
        return warn(words, remedy, machine=machine, bits=bits)
    libc, number = platform.libc_ver()
    if libc != "glibc" or tuple(int(part) for part in number.split(".")[:2]) < LIBC:
        remedy = "Wheels are for glibc 2.28 and newer: Debian 10, Ubuntu 20.04, or later."
        return warn(f"{words}, {libc or 'no glibc'} {number}", remedy, machine=machine, bits=bits)
    if machine not in WHEELS:
        return warn(f"{words}: packages may have to be compiled", "Use x86-64 or aarch64.", machine=machine, bits=bits)
    return ok(f"{words}, {libc} {number}", machine=machine, bits=bits)


def packages(_: Patient) -> list[Finding]:
    """What is installed; parts that are not are no fault."""
    findings = []
    missing = [name for name in BASE if not _has(name)]
    if missing:
        findings.append(fail(f"not installed: {', '.join(missing)}", "Install it again: pip install lira-rosbot"))
    parts: dict[str, list[str]] = {}
    for package, extra in EXTRAS.items():
        parts.setdefault(extra, []).append(package)
    there = [extra for extra, names in parts.items() if all(_has(name) for name in names)]
    lacking = [extra for extra in parts if extra not in there]
    words = f"lira {_version('lira-rosbot')} with {', '.join(there) or 'no extras'}"
    if lacking:
        words += f" (not installed: {', '.join(lacking)}; pip install 'lira-rosbot[{','.join(lacking)}]')"
    findings.append(ok(words, extras=there, lacking=lacking, requirements=len(requires("lira-rosbot") or [])))
    return findings


def disk(_: Patient) -> Finding:
    """Whether there is room for labels, where this was started."""
    here = Path.cwd()
    free = shutil.disk_usage(here).free
    words = f"{free / 1e9:.1f} GB free in {here}"
    if not os.access(here, os.W_OK):
        return warn(f"{words}, which cannot be written", "Start in a folder of your own.", free_bytes=free)
    if free < TIGHT_BYTES:
        return fail(words, "Make room: labels and pictures will not be stored.", free_bytes=free)
    if free < LITTLE_BYTES:
        return warn(words, "Make room before a long session.", free_bytes=free)
    return ok(words, free_bytes=free)


def memory(_: Patient) -> Finding:
    """Whether there is memory left."""
    page = os.sysconf("SC_PAGE_SIZE")
    free = page * os.sysconf("SC_AVPHYS_PAGES")
    for line in _text("/proc/meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            free = 1024 * int(line.split()[1])
    words = f"{free / 1e9:.1f} GB of memory available"
    if free < SMALL_BYTES:
        return warn(words, "End other programs; the learner needs most.", free_bytes=free)
    return ok(words, free_bytes=free)


def load(_: Patient) -> Finding:
    """Whether the processor has time left, and how long a thread waits for it that asked for 2 ms."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    busy = os.getloadavg()[0]
    longest_s = 0.0
    for _nap in range(NAPS):
        start_s = time.monotonic()
        time.sleep(ASLEEP_S)
        longest_s = max(longest_s, time.monotonic() - start_s - ASLEEP_S)
    words = f"{plural(cores, 'core')}, load {busy:.1f}, longest wait for them {1e3 * longest_s:.0f} ms"
    values = {"cores": cores, "load": busy, "longest_wait_s": longest_s}
    if longest_s > STALL_S or busy > 2 * cores:
        return warn(words, "End other programs: what comes late is refused, and the robot stands.", **values)
    return ok(words, **values)


def clock(_: Patient) -> Finding:
    """Whether somebody sets the clock: ROS peers and other machines compare stamps with theirs."""
    state = _kernel_clock()
    if state is None:
        return warn("cannot tell whether the clock is set", "See timedatectl.")
    error, unset, away_s = state
    words = "the clock is set" if not (error or unset) else "nobody sets the clock"
    if error or unset:
        return warn(words, "Switch it on: sudo timedatectl set-ntp true", synchronised=False)
    return ok(f"{words}, to within {1e3 * away_s:.0f} ms", synchronised=True, error_s=away_s)


def screen(_: Patient) -> Finding:
    """Whether there is a screen for `lira console`."""
    name = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    return ok(f"screen {name}" if name else "no screen: lira console needs one, nothing else does", screen=bool(name))


def sound(_: Patient) -> Finding:
    """Whether calls of the robot can be heard."""
    cards = [line for line in _text("/proc/asound/cards").splitlines() if line.strip()[:1].isdigit()]
    return ok("sound" if cards else "no sound card: calls are seen and felt, not heard", sound=bool(cards))


def _kernel_clock() -> tuple[bool, bool, float] | None:
    """What adjtimex(2) says: whether it is in error, not set, and by how much it may be off, in seconds."""
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        buffer = (ctypes.c_long * 64)()  # more than struct timex
        state = int(libc.adjtimex(ctypes.byref(buffer)))
    except (OSError, AttributeError):
        return None
    if state < 0:
        return None
    # modes, offset, freq, maxerror, esterror, status: the first and the last are ints, padded to longs.
    status = int(buffer[5]) & 0xFFFFFFFF
    return state == TIME_ERROR, bool(status & STA_UNSYNC), int(buffer[3]) / 1e6


def _has(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except (ImportError, ValueError):
        return False


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "?"


def _text(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
