"""The table of checks, and the way through it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from lira.hal.errors import LiraError
from lira.tools.cli import told_of
from lira.tools.doctor.finding import Finding, Level, Patient, fail

Look = Callable[[Patient], Finding | Sequence[Finding]]


@dataclass(frozen=True, slots=True)
class Check:
    """One row: its name, where it is (module and function, loaded when its turn comes), and what has to be named."""

    name: str
    place: str
    wanted: str = ""

    def applies(self, patient: Patient) -> bool:
        """Whether it was asked for."""
        return not self.wanted or bool(getattr(patient, self.wanted))


HERE = "lira.tools.doctor"
CHECKS = (
    Check("python", f"{HERE}.machine:python"),
    Check("processor", f"{HERE}.machine:processor"),
    Check("packages", f"{HERE}.machine:packages"),
    Check("disk", f"{HERE}.machine:disk"),
    Check("memory", f"{HERE}.machine:memory"),
    Check("load", f"{HERE}.machine:load"),
    Check("clock", f"{HERE}.machine:clock"),
    Check("screen", f"{HERE}.machine:screen"),
    Check("sound", f"{HERE}.machine:sound"),
    Check("serial ports", f"{HERE}.access:serial_ports"),
    Check("cameras", f"{HERE}.access:cameras"),
    Check("pads", f"{HERE}.access:pads"),
    Check("keys", f"{HERE}.access:keys"),
    Check("network ports", f"{HERE}.access:ports"),
    Check("robot", f"{HERE}.network:robot", "connect"),
    Check("lidar", f"{HERE}.sensors:lidar", "lidar"),
    Check("base", f"{HERE}.sensors:base", "base"),
    Check("camera", f"{HERE}.sensors:camera", "camera"),
    Check("pad", f"{HERE}.pads:pad", "pad"),
)


def examine(patient: Patient, checks: Sequence[Check] = CHECKS) -> Iterator[tuple[str, Finding]]:
    """Run what applies, one after the other; a check that fails says so and ends no other."""
    for check in checks:
        if check.applies(patient):
            for finding in _run(check, patient):
                yield check.name, finding


def worst(findings: Sequence[Finding]) -> Level:
    """The worst level among findings."""
    order = list(Level)
    return max((finding.level for finding in findings), key=order.index, default=Level.OK)


def _run(check: Check, patient: Patient) -> list[Finding]:
    try:
        found = _load(check.place)(patient)
    except Exception as error:  # noqa: BLE001 - a doctor goes on to the next patient
        return [_failure(error)]
    return [found] if isinstance(found, Finding) else list(found)


def _failure(error: Exception) -> Finding:
    told = error if isinstance(error, LiraError) else told_of(error)
    if told is None:
        words = " ".join(str(error).split())[:200]
        return fail(f"the check itself failed: {type(error).__name__}: {words}", "Report this line.")
    return fail(told.what, told.remedy)


def _load(place: str) -> Look:
    import importlib

    module, _, function = place.partition(":")
    look: Look = getattr(importlib.import_module(module), function)
    return look
