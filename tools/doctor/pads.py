"""The gamepad, live: what it is, whether it rests, whether its silence would be noticed, and its battery."""

import select
import time
from pathlib import Path

from lira.tools.doctor.finding import Finding, Patient, fail, ok, warn
from lira.tools.joystick.axes import PadState, unrest
from lira.tools.joystick.bridge import layout_words
from lira.tools.joystick.device.finder import Finder
from lira.tools.joystick.device.pad import Pad
from lira.tools.joystick.device.rules import REMEDY

LISTEN_S = 2.0
LOW_PERCENT = 15
NEAR = 0.7  # of the dead zone: a stick that rests there will soon leave it


def pad(patient: Patient) -> list[Finding]:
    """Open the pad, leave it alone, and look at what it says."""
    finder = Finder(None, patient.device)
    device = finder()
    if device is None:
        return [fail(finder.advice(), "See /proc/bus/input/devices for what the kernel knows.", pad="")]
    try:
        states, reports = _listen(device, min(LISTEN_S, patient.seconds))
    finally:
        device.close()
    mapping = device.mapping
    findings = [ok(f"{device.name}, layout {mapping.name}; {layout_words(mapping)}", pad=device.name)]
    findings.append(_rest(device, states))
    if device.motion_trouble:
        findings.append(warn("its motion sensors may not be read: nobody will notice if it freezes", REMEDY))
    elif device.has_motion:
        findings.append(ok(f"motion sensors, {reports / min(LISTEN_S, patient.seconds):.0f} reports a second"))
    elif mapping.freeze:
        remedy = "Update the kernel: hid-playstation and hid-nintendo bring them."
        findings.append(warn("its motion sensors are not there: nobody will notice if it freezes", remedy))
    return [*findings, *_battery(device.key.rsplit("/", 1)[-1])]


def _listen(device: Pad, seconds: float) -> tuple[list[PadState], int]:
    states, reports = [device.state], 0
    until_s = time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0.0:
        select.select(device.fileno_list(), [], [], left_s)
        new, heard = device.read()
        states += new
        reports += heard
    return states, reports


def _rest(device: Pad, states: list[PadState]) -> Finding:
    """The furthest that the sticks which drive were from their middle, against the dead zone."""
    mapping = device.mapping
    if held := unrest(states[-1], mapping):
        remedy = "Let go of it. A worn stick needs a larger dead_zone, in a file of its own: lira joystick --learn FILE"
        return fail(f"not at rest: {', '.join(held)}", remedy)
    axes = (mapping.forward.axis, mapping.turn.axis)
    drift = max(abs(state.reads(axis)) for state in states for axis in axes)
    words = f"drift {drift:.2f} of a dead zone of {mapping.dead_zone:.2f}"
    if drift > NEAR * mapping.dead_zone:
        return warn(words, "Give it a larger dead_zone before it begins to creep.", drift=drift)
    return ok(words, drift=drift)


def _battery(address: str) -> list[Finding]:
    """What the kernel knows of the battery of a pad with that address."""
    for supply in Path("/sys/class/power_supply").glob("*"):
        if not address or address.replace(":", "").lower() not in supply.name.replace(":", "").lower():
            continue
        try:
            percent = int((supply / "capacity").read_text(encoding="ascii"))
        except (OSError, ValueError):
            continue
        words = f"battery {percent} %"
        if percent < LOW_PERCENT:
            return [warn(words, "Charge it, or drive by cable.", percent=percent)]
        return [ok(words, percent=percent)]
    return []
