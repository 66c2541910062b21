"""Lidar, base and camera, live: what each is, how often it measures, how old that is, and what gets lost."""

import math
import statistics
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from lira.hal.bus.topics import CAMERA, ODOM, SCAN
from lira.hal.errors import StorageError
from lira.hal.messages import CompressedImage, DepthImage, LaserScan
from lira.hal.words import plural
from lira.robot.camera.address import shown
from lira.robot.camera.device import CameraDevice
from lira.robot.camera.port import Picture
from lira.robot.core2.device import Core2
from lira.robot.rplidar.device import RPLidar
from lira.robot.settings import load_settings
from lira.tools.doctor.finding import Finding, Patient, fail, need, ok, warn
from lira.tools.doctor.live import listen

EMPTY = 0.5  # of a scan's beams: more is a lidar that sees glass, black walls, or a hand
SLOW = 0.8  # of the rate that a topic promises
LOW_V, EMPTY_V = 10.8, 10.0  # three cells in series
STILL_M_S = 0.02


def lidar(patient: Patient) -> list[Finding]:
    """Open it, spin it, listen to its scans, and stop it."""
    scans: list[tuple[LaserScan, float]] = []
    settings = load_settings(patient.settings).lidar
    device = RPLidar(
        need(patient.lidar), patient.profile.lidar, settings, lambda scan: scans.append((scan, time.monotonic()))
    )
    began_s = listen(device.session, patient.seconds)
    info = device.info
    firmware = "" if info is None else f", model {info.model:#x}, firmware {info.firmware[0]}.{info.firmware[1]:02d}"
    findings = [ok(f"RPLIDAR at {patient.lidar}{firmware}, first scan after {began_s:.1f} s", began_s=began_s)]
    ages_s = [came_s - scan.stamp_s for scan, came_s in scans]
    findings.append(_rate("scans", [scan.stamp_s for scan, _ in scans], patient.profile.lidar.rate_hz, ages_s))
    if scans:
        empty = statistics.fmean(float(np.isnan(scan.ranges).mean()) for scan, _ in scans)
        words = f"{100 * empty:.0f} % of {len(scans[-1][0].ranges)} beams say nothing"
        remedy = "Clean the window; look for glass, black or far surfaces; nothing may stand in its way."
        findings.append(warn(words, remedy, empty=empty) if empty > EMPTY else ok(words, empty=empty))
    lost = device.counts.lost_bytes
    if lost:
        remedy = "Use a port of its own, a shorter cable, no hub."
        findings.append(warn(f"{plural(lost, 'byte')} of its line lost", remedy, lost_bytes=lost))
    return findings


def base(patient: Patient) -> list[Finding]:
    """Open it and listen. It is told to stand all the time."""
    profile = patient.profile
    device = Core2(need(patient.base), load_settings(patient.settings).base, profile.control.robot_timeout_s)
    stamps_s: list[float] = []
    ages_s: list[float] = []
    speeds: list[float] = []

    def look() -> None:
        odom = device.readings.odom
        if odom is not None and (not stamps_s or odom.stamp_s != stamps_s[-1]):
            stamps_s.append(odom.stamp_s)
            ages_s.append(time.monotonic() - odom.stamp_s)
            speeds.append(abs(odom.linear_m_s))

    began_s = listen(device.session, patient.seconds, look)
    readings = device.readings
    words = f"CORE2 at {patient.base}, {device.baud} baud, answers after {began_s:.1f} s"
    findings = [ok(words, began_s=began_s, baud=device.baud or 0), _rate("odometry", stamps_s, ODOM.rate_hz, ages_s)]
    if speeds and max(speeds) > STILL_M_S:
        remedy = "Let it stand while it is looked at; else its encoders or its firmware drift."
        findings.append(warn(f"it reports {max(speeds):.2f} m/s though it stands", remedy, speed_m_s=max(speeds)))
    findings.append(_battery(None if readings.battery is None else readings.battery.voltage_v))
    missing = [name for name, value in (("imu", readings.imu), ("ranges", readings.ranges)) if not value]
    if missing:
        findings.append(warn(f"nothing came from: {', '.join(missing)}", "Check the firmware: 0.14.3 to 0.16.2."))
    if device.counts.lost_bytes:
        words = f"{plural(device.counts.lost_bytes, 'byte')} of its line lost"
        findings.append(warn(words, "Check the cable, and that no console runs on that port."))
    return findings


def camera(patient: Patient) -> list[Finding]:
    """Open it, look at its pictures, and keep one with `--out`."""
    pictures: list[tuple[Picture, float]] = []
    where = shown(need(patient.camera))

    def put(picture: Picture | DepthImage) -> None:
        if not isinstance(picture, DepthImage):
            pictures.append((picture, time.monotonic()))

    wanted = patient.profile.camera
    device = CameraDevice(need(patient.camera), wanted, put, patient.openni)
    began_s = listen(device.session, patient.seconds)
    last = pictures[-1][0]
    form = "JPEGs as they come" if isinstance(last, CompressedImage) else "pixels, scaled where they have to be"
    size = f"{wanted.width_px} x {wanted.height_px}"
    findings = [ok(f"camera at {where}, {size}, {form}, first picture after {began_s:.1f} s", began_s=began_s)]
    ages_s = [came_s - picture.stamp_s for picture, came_s in pictures]
    findings.append(_rate("pictures", [picture.stamp_s for picture, _ in pictures], wanted.rate_hz, ages_s))
    late = sum(age_s > CAMERA.max_age_s for age_s in ages_s)
    if late:
        remedy = "Smaller pictures, a better network, a faster computer."
        findings.append(warn(f"{late} of {len(pictures)} pictures were too old to use", remedy, late=late))
    if device.unreadable:
        remedy = "Set it to JPEGs of the profile's shape."
        findings.append(warn(f"{plural(device.unreadable, 'picture')} refused", remedy, refused=device.unreadable))
    if patient.out is not None:
        findings.append(_keep(last, patient.out))
    return findings


def _keep(picture: Picture, path: Path) -> Finding:
    data = picture.data if isinstance(picture, CompressedImage) else None
    if data is None:
        done, encoded = cv2.imencode(".jpg", np.ascontiguousarray(np.asarray(picture.data)[..., ::-1]))
        data = encoded.tobytes() if done else b""
    try:
        path.write_bytes(data)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another --out.") from error
    return ok(f"a picture: {path}", out=str(path))


def _rate(what: str, stamps_s: Sequence[float], wanted_hz: float, ages_s: Sequence[float]) -> Finding:
    """How often something came, and how old it was then."""
    if len(stamps_s) < 2:
        return fail(f"hardly any {what} came", "Check plug, power and network.", rate_hz=0.0)
    rate_hz = (len(stamps_s) - 1) / max(stamps_s[-1] - stamps_s[0], 1e-9)
    ages = np.asarray(ages_s)
    median_s, worst_s = float(np.median(ages)), float(np.max(ages))
    words = f"{what} {rate_hz:.1f} Hz, {1e3 * median_s:.0f} ms old, at worst {1e3 * worst_s:.0f} ms"
    values = {"rate_hz": rate_hz, "age_s": median_s, "worst_age_s": worst_s}
    if rate_hz < SLOW * wanted_hz:
        return warn(f"{words}; the profile says {wanted_hz:.0f} Hz", "Check cable, network and load.", **values)
    if median_s > SCAN.max_age_s:
        return warn(words, "That is too old to drive by: check network and load.", **values)
    return ok(words, **values)


def _battery(voltage: float | None) -> Finding:
    if voltage is None or not math.isfinite(voltage):
        return warn("the battery says nothing", "Check the firmware: 0.14.3 to 0.16.2.")
    words = f"battery {voltage:.1f} V"
    if voltage < EMPTY_V:
        return fail(words, "Charge it now: the cells are being harmed.", voltage=voltage)
    if voltage < LOW_V:
        return warn(words, f"Charge it: below {LOW_V} V the motors get weak.", voltage=voltage)
    return ok(words, voltage=voltage)
