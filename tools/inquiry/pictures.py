"""What a robot saw at a moment, as files: the picture as it came, the scan as a drawing and as numbers."""

from pathlib import Path

import numpy as np

from lira.hal.bus.topics import CAMERA, SCAN
from lira.hal.config import write_whole
from lira.hal.messages import CompressedImage, LaserScan
from lira.tools.inquiry.moment import Moment
from lira.tools.report.svg import dots, drawing, path

BEAM, ROBOT = "stroke:#357;stroke-width:.05", "stroke:#c33;stroke-width:.15"
STYLE = f"<style>path{{stroke-linecap:round}}.beam{{{BEAM}}}.robot{{{ROBOT}}}</style>"


def write_pictures(moment: Moment, folder: Path) -> list[Path]:
    """Write what there is into a folder, and return which files. Raises `StorageError`."""
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    picture: CompressedImage | None = moment.message(CAMERA)
    if picture is not None:
        found.append(folder / f"picture.{'png' if 'png' in picture.format else 'jpg'}")
        write_whole(found[-1], picture.data)
    scan: LaserScan | None = moment.message(SCAN)
    if scan is not None:
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        rows = "".join(f"{angle:.5f},{distance:.4f}\n" for angle, distance in zip(angles, scan.ranges, strict=True))
        found.append(folder / "scan.csv")
        write_whole(found[-1], f"angle_rad,range_m\n{rows}".encode())
        found.append(folder / "scan.svg")
        write_whole(found[-1], scan_drawing(scan, moment.head.info.profile.features.max_range_m).encode())
    return found


def scan_drawing(scan: LaserScan, reach_m: float) -> str:
    """The scan from above: x to the top, y to the left, in metres; the robot in the middle."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    seen = (scan.ranges > 0.0) & (scan.ranges < reach_m)
    points = np.stack([-np.sin(angles), -np.cos(angles)], axis=1)[seen] * scan.ranges[seen, None]
    parts = [STYLE, path(dots((x, y) for x, y in points.tolist()), "beam"), path(dots([(0.0, 0.0)]), "robot")]
    box = (-reach_m, -reach_m, 2 * reach_m, 2 * reach_m)
    return drawing(box, parts, "The scan from above", attributes='xmlns="http://www.w3.org/2000/svg"')
