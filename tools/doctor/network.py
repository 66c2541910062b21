"""The way to a robot: who answers, over how many links, how fast, and what gets lost on it."""

import math
import statistics
import time
from contextlib import closing

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info
from lira.hal.bus.topics import INFO, ODOM, SCAN
from lira.hal.words import plural
from lira.tools.doctor.finding import Finding, Patient, fail, need, ok, warn

ANSWER_S = 5.0
QUESTIONS = 50
SLOW_S = 0.05  # of the 0.3 s after which a command is refused
WORST_S = 0.25
LOST = 0.02
POLL_S = 0.005


def robot(patient: Patient) -> list[Finding]:
    """Ask the robot, again and again; then listen for what it sends."""
    with closing(Bus(patient.name, connect=need(patient.connect))) as bus:
        info = ask_info(bus, ANSWER_S)
        findings = [ok(f"robot '{patient.name}', profile {info.profile.name}, {info.mode}", mode=str(info.mode))]
        findings.append(_round_trip(bus))
        findings.append(_links(bus))
        findings.append(_losses(bus, patient.seconds))
    return findings


def _round_trip(bus: Bus) -> Finding:
    times_s = []
    for _ in range(QUESTIONS):
        start_s = time.monotonic()
        bus.ask(INFO, timeout_s=ANSWER_S)
        times_s.append(time.monotonic() - start_s)
    median_s, worst_s = statistics.median(times_s), max(times_s)
    words = f"round trip {1e3 * median_s:.1f} ms, at worst {1e3 * worst_s:.0f} ms of {QUESTIONS}"
    if median_s > SLOW_S or worst_s > WORST_S:
        remedy = "Use 5 GHz or a cable, stand nearer, switch off power saving: sudo iw dev WLAN set power_save off"
        return warn(words, remedy, round_trip_s=median_s, worst_s=worst_s)
    return ok(words, round_trip_s=median_s, worst_s=worst_s)


def _links(bus: Bus) -> Finding:
    count, short = bus.links(), bus.short_peers()
    if short:
        remedy = "Open the robot's port for UDP, too, in every firewall between: over TCP alone commands come late."
        return warn(f"{plural(count, 'link')}: UDP does not get through", remedy, links=count)
    return ok(f"{plural(count, 'link')}, TCP and UDP", links=count)


def _losses(bus: Bus, seconds: float) -> Finding:
    """Count what came of what was sent, by the senders' own numbers."""
    readers = {topic.key: bus.reader(topic, 256) for topic in (ODOM, SCAN)}
    numbers: dict[str, set[int]] = {key: set() for key in readers}
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        for key, reader in readers.items():
            numbers[key] |= {received.attachment.seq for received in reader.poll() if received.attachment is not None}
        time.sleep(POLL_S)
    heard = sum(map(len, numbers.values()))
    sent = sum(max(each) - min(each) + 1 for each in numbers.values() if each)
    if not heard:
        remedy = "Look at what the robot says: its devices may be lost."
        return fail(f"nothing came on {' or '.join(readers)} in {seconds:.0f} s", remedy, heard=0)
    rates = {key: len(each) / seconds for key, each in numbers.items()}
    lost = 1.0 - heard / sent if sent else math.nan
    words = ", ".join(f"{key} {rate:.1f} Hz" for key, rate in rates.items()) + f", {100 * lost:.1f} % lost"
    if lost > LOST:
        return warn(words, "Use 5 GHz or a cable, or stand nearer.", lost=lost, **rates)
    return ok(words, lost=lost, **rates)
