"""One picture of a world: the floor from above, and below it what the robot's camera sees at a few places."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import ByteArray
from lira.hal.profile import RobotProfile
from lira.sim_backend.camera import PinholeCamera
from lira.sim_backend.course import Course, footprint_radius_m
from lira.sim_backend.layout import Block, Layout, Mark, outline
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import Pose
from lira.sim_backend.scenes.sketch import SketchScene

WIDE_PX = 960
HIGH_PX = 560  # of the view from above, at most
LETTERS = "ABCDEF"
LETTER_PX = 26  # the strip above a view that holds its letter
BORDER_PX = 4
ARROW_PX = 18
MARGIN_M = 2.0
# With the nose on a box the camera sees nothing else: step back along the way.
FREE_M = 0.5
BACK_M = 0.1
# Blue, green, red. A box gets an outline, or it could not be told from a line of its own gray.
OUTLINE = (0, 140, 255)
WAY = (200, 0, 160)
PLACE = (40, 40, 230)
INK = (0, 0, 0)
PAPER = (255, 255, 255)


def draw(layout: Layout, profile: RobotProfile) -> ByteArray:
    """Draw the floor above the camera's views: uint8 [height, width, 3], blue, green, red."""
    poses = view_poses(Course(layout, footprint_radius_m(profile.base)))
    return np.concatenate([from_above(layout, poses), from_the_robot(layout, profile, poses)])


def view_poses(course: Course) -> list[Pose]:
    """Return the poses, spread along the way, from which the camera looks."""
    way_m = course.limits.finish_m or course.layout.curve.length_m
    return [free_pose(course, at_m) for at_m in np.arange(len(LETTERS)) / len(LETTERS) * way_m]


def free_pose(course: Course, at_m: float) -> Pose:
    """Return a pose on the way with some room around it, at `at_m` or before."""
    pose = Pose(*course.layout.curve.pose(at_m))
    while at_m > 0.0 and course.clearance(np.array(pose[:2])) < FREE_M:
        at_m = max(at_m - BACK_M, 0.0)
        pose = Pose(*course.layout.curve.pose(at_m))
    return pose


def from_above(layout: Layout, poses: list[Pose]) -> ByteArray:
    """Draw the floor with x to the right and y up; what hangs above it is outlined only."""
    sheet = Sheet(layout)
    for mark in layout.marks:
        sheet.fill(outline(mark), mark.gray)
    line, paint = layout.world.line, layout.paint
    if line is not None and paint is not None:
        sheet.paint(paint, line.gray, line.width_m)
    if layout.hidden_way:
        sheet.dash(layout.curve.points)
    for block in layout.blocks:
        if not block.bottom_m:
            sheet.fill(outline(block), block.gray)
        sheet.frame(outline(block))
    for letter, pose in zip(LETTERS, poses, strict=True):
        sheet.mark(letter, pose)
    return sheet.picture


def from_the_robot(layout: Layout, profile: RobotProfile, poses: list[Pose]) -> ByteArray:
    """Put the camera's views side by side, each below its letter."""
    shape = profile.camera
    camera = PinholeCamera(shape, SketchScene(layout))
    wide_px = WIDE_PX // len(LETTERS) - 2 * BORDER_PX
    high_px = round(wide_px * shape.height_px / shape.width_px)
    resize = cv2.INTER_NEAREST if wide_px > shape.width_px else cv2.INTER_AREA
    strip = np.full((LETTER_PX + high_px + BORDER_PX, WIDE_PX, 3), PAPER, np.uint8)
    for number, (letter, pose) in enumerate(zip(LETTERS, poses, strict=True)):
        left_px = number * WIDE_PX // len(LETTERS) + BORDER_PX
        view = cv2.resize(camera.render(pose), (wide_px, high_px), interpolation=resize)
        strip[LETTER_PX : LETTER_PX + high_px, left_px : left_px + wide_px] = view[..., None]
        cv2.putText(strip, letter, (left_px, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    return strip


class Sheet:
    """The view from above of a whole layout, to be drawn on in metres. `picture` is uint8 [height, width, 3]."""

    def __init__(self, layout: Layout) -> None:
        pieces: list[Block | Mark] = [*layout.blocks, *layout.marks]
        everything = np.concatenate([layout.curve.points, *map(outline, pieces)])
        low, high = everything.min(0) - MARGIN_M, everything.max(0) + MARGIN_M
        wide_m, high_m = (high - low).tolist()
        self._px_m = min(WIDE_PX / wide_m, HIGH_PX / high_m)
        # In the middle, if the floor is not as wide as the sheet.
        self._corner = (low[0] - (WIDE_PX / self._px_m - wide_m) / 2, high[1])
        shape = (round(high_m * self._px_m), WIDE_PX, 3)
        self.picture: ByteArray = np.full(shape, layout.world.ground_gray, np.uint8)

    def fill(self, corners: Floats, gray: int) -> None:
        """Fill an outline with a gray."""
        cv2.fillPoly(self.picture, [self._pixels(corners)], (gray,) * 3, cv2.LINE_AA)

    def frame(self, corners: Floats) -> None:
        """Draw the outline of a box."""
        cv2.polylines(self.picture, [self._pixels(corners)], True, OUTLINE, 1, cv2.LINE_AA)

    def paint(self, points: Floats, gray: int, width_m: float) -> None:
        """Draw a painted line."""
        width_px = max(round(width_m * self._px_m), 1)
        cv2.polylines(self.picture, [self._pixels(points)], False, (gray,) * 3, width_px, cv2.LINE_AA)

    def dash(self, points: Floats) -> None:
        """Draw a way that is not painted on the floor."""
        pixels = self._pixels(points)
        for dash in zip(pixels[:-2:4].tolist(), pixels[2::4].tolist(), strict=False):
            cv2.line(self.picture, *dash, WAY, 1, cv2.LINE_AA)

    def mark(self, letter: str, pose: Pose) -> None:
        """Draw an arrow where the robot stands, and its letter."""
        x, y = self._pixels(np.array([pose[:2]]))[0].tolist()
        ahead = (round(x + ARROW_PX * math.cos(pose[2])), round(y - ARROW_PX * math.sin(pose[2])))
        cv2.arrowedLine(self.picture, (x, y), ahead, PLACE, 2, cv2.LINE_AA, tipLength=0.4)
        # To the left of the arrow's tail: a line is not written over, and two places in one keep their letters apart.
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        beside = (round(x - 8 * cos - 13 * sin) - 5, round(y + 8 * sin - 13 * cos) + 5)
        cv2.putText(self.picture, letter, beside, cv2.FONT_HERSHEY_SIMPLEX, 0.5, PLACE, 1, cv2.LINE_AA)

    def _pixels(self, points: Floats) -> NDArray[np.int32]:
        pixels: NDArray[np.int32] = np.rint((points - self._corner) * (self._px_m, -self._px_m)).astype(np.int32)
        return pixels
