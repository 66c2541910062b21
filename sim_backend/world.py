"""A world as data: a TOML file says what lies on the floor. What is random in it is drawn in `layout.py`.

Angles are in degrees in the file, because people write it by hand; everything that leaves `layout.py` is SI.
"""

import math
from typing import Annotated

from msgspec import Meta

from lira.hal.config import Table

# Whatever is beyond a kilometre is a slip of the unit, or not a number.
Metres = Annotated[float, Meta(ge=-1000.0, le=1000.0)]
Size = Annotated[float, Meta(gt=0.0, le=1000.0)]
Gap = Annotated[float, Meta(ge=0.0, le=1000.0)]
Degrees = Annotated[float, Meta(ge=-360.0, le=360.0)]
Few = Annotated[int, Meta(ge=1, le=1000)]
Gray = Annotated[int, Meta(ge=0, le=255)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]

# A line that is said to close may miss its own beginning by rounding in the file, no more.
CLOSING_M = 0.05
CLOSING_DEG = 1.0
MAX_JOINTS = 500
# More than these take minutes to lay out, or more memory than there is.
MAX_LINE_M = 10_000.0
MAX_PIECES = 10_000
MAX_BOXES = 1000
MAX_SCATTERS = 100


def refuse_empty(**ranges: tuple[float, float]) -> None:
    """Raise `ValueError` for a range that does not run upwards."""
    for name, (low, high) in ranges.items():
        if low >= high:
            raise ValueError(f"{name} = {[low, high]} must be [from, to] with from < to")


class Start(Table, frozen=True):
    """Where the robot starts and where the line begins."""

    x_m: Metres = 0.0
    y_m: Metres = 0.0
    yaw_deg: Degrees = 0.0


class Piece(Table, frozen=True):
    """A straight (`straight_m`) or an arc (`radius_m` and `angle_deg`, positive to the left)."""

    straight_m: Size | None = None
    radius_m: Size | None = None
    angle_deg: Degrees | None = None

    def __post_init__(self) -> None:
        """Accept exactly one of the two kinds."""
        arc = self.radius_m is not None and self.angle_deg is not None
        half = (self.radius_m is None) != (self.angle_deg is None)
        if half or arc == (self.straight_m is not None):
            raise ValueError("a piece is either straight_m, or radius_m together with angle_deg")
        if self.angle_deg == 0.0:
            raise ValueError("an arc of angle_deg = 0 is not an arc: use straight_m")

    @property
    def length_m(self) -> float:
        """Length along the piece."""
        if self.straight_m is not None:
            return self.straight_m
        return (self.radius_m or 0.0) * abs(math.radians(self.angle_deg or 0.0))


class Line(Table, frozen=True):
    """The line to follow, beginning at `start`. `pieces` are laid end to end, `repeat` times.

    The paint lies `offset_m` to the left of it, for an edge that is followed at a distance. A line that is not
    `painted` cannot be seen: it tells teacher and referee the way where something else shows it.
    """

    pieces: Annotated[tuple[Piece, ...], Meta(min_length=1)]
    repeat: Few = 1
    closed: bool = False
    width_m: Size = 0.1
    gray: Gray = 0
    offset_m: Metres = 0.0
    painted: bool = True

    def __post_init__(self) -> None:
        """Refuse a line that nobody drives to its end."""
        length_m = sum(piece.length_m for piece in self.pieces) * self.repeat
        if length_m > MAX_LINE_M or len(self.pieces) * self.repeat > MAX_PIECES:
            raise ValueError(f"a line of {length_m:.0f} m in {len(self.pieces) * self.repeat} pieces is too long")


class Patch(Table, frozen=True):
    """A rectangle painted on the floor: the camera sees it, nothing else meets it."""

    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees = 0.0
    length_m: Size = 0.45
    width_m: Size = 0.45
    gray: Gray = 255


class Tiles(Table, frozen=True):
    """Square tiles over a rectangle: joints of another gray than the ground's. `x_m` and `y_m` are [from, to]."""

    x_m: tuple[Metres, Metres]
    y_m: tuple[Metres, Metres]
    size_m: Size = 0.5
    joint_m: Size = 0.01
    gray: Gray = 120

    def __post_init__(self) -> None:
        """Refuse an empty rectangle, and more joints than anybody lays."""
        refuse_empty(x_m=self.x_m, y_m=self.y_m)
        joints = sum((high - low) / self.size_m for low, high in (self.x_m, self.y_m))
        if joints > MAX_JOINTS:
            raise ValueError(f"tiles of size_m = {self.size_m:g} over this area have {joints:.0f} joints: enlarge them")


class Box(Table, frozen=True):
    """A box with its sides upright. It stands on the floor, or has `bottom_m` of free room below it."""

    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees = 0.0
    length_m: Size = 0.45
    width_m: Size = 0.45
    height_m: Size = 0.45
    bottom_m: Gap = 0.0
    gray: Gray = 0


class Mesh(Table, frozen=True):
    """A thing with a shape of its own, from a file: only pybullet draws and scans it, in one gray.

    The referee knows boxes alone: put one where it must not be touched. `path` is from the world's file.
    """

    path: Annotated[str, Meta(pattern=r"\.(obj|stl|urdf)$")]
    x_m: Metres
    y_m: Metres
    z_m: Metres = 0.0
    yaw_deg: Degrees = 0.0
    scale: Annotated[float, Meta(gt=0.0, le=1000.0)] = 1.0
    gray: Gray = 0


class Along(Table, frozen=True):
    """Boxes scattered along the line, at least `spacing_m` from centre to centre along it.

    A share `on` of them stands on the line, up to `on_lateral_m` off its middle; the rest beside it, with the centre
    `beside_m` = [nearest, farthest] to either side. `clear_m` of line stay free at the start (and before a closed
    line's end, which is the same place). They are cubes of `size_m` unless `height_m` says otherwise. A share `fake`
    is only painted on the floor, `fake_m` = [length, width]. A share `tops` are table tops: slabs of `tops_gray` with
    free room below them, `tops_m` = [height of the lower side, thickness].
    """

    count: Few
    spacing_m: Size = 4.0
    clear_m: Gap = 4.0
    on: Share = 1.0
    on_lateral_m: Gap = 0.0
    beside_m: tuple[Size, Size] = (0.5, 1.0)
    size_m: Size = 0.45
    height_m: Size | None = None
    gray: Gray = 0
    fake: Share = 0.0
    fake_m: tuple[Size, Size] = (0.45, 0.45)
    tops: Share = 0.0
    tops_m: tuple[Size, Size] = (0.27, 0.02)
    tops_gray: Gray = 0

    def __post_init__(self) -> None:
        """Refuse an empty lateral range, and more kinds than there are boxes."""
        if self.fake + self.tops > 1.0:
            raise ValueError(f"fake = {self.fake:g} and tops = {self.tops:g} are more than all")
        if self.beside_m[0] > self.beside_m[1]:
            raise ValueError(f"beside_m = {list(self.beside_m)} must be [nearest, farthest]")


class Area(Table, frozen=True):
    """Boxes scattered over a rectangle, with at least `gap_m` of free floor between any two.

    `x_m` and `y_m` are [from, to]. From the near end to the far end in x the density grows from `sparse` times
    the mean up to its mirror (1: even, 0: empty at the near end). They are cubes of `size_m` unless `height_m` says
    otherwise, and have `bottom_m` of free room below them.
    """

    count: Few
    x_m: tuple[Metres, Metres]
    y_m: tuple[Metres, Metres]
    gap_m: Gap = 0.8
    sparse: Share = 1.0
    size_m: Size = 0.45
    height_m: Size | None = None
    bottom_m: Gap = 0.0
    gray: Gray = 0

    def __post_init__(self) -> None:
        """Refuse an empty rectangle."""
        refuse_empty(x_m=self.x_m, y_m=self.y_m)


class Limits(Table, frozen=True):
    """When a drive is lost or finished.

    With a line: lost when farther than `lost_m` from it, or, where no box is within `free_m` and there is nothing to
    drive around, farther than `stray_m`; finished after `laps` of a closed line or at `finish_m`
    along an open one. Without a line both are measured from the straight ahead of the start.
    """

    lost_m: Size
    stray_m: Size | None = None
    free_m: Size = 1.0
    laps: Few = 1
    finish_m: Size | None = None


class World(Table, frozen=True):
    """A whole world. `name` is filled in from the file's name.

    In one that is `randomised`, grays, noise, the camera's mounting and the wheels' slip differ from layout to layout,
    as `shifts.py` draws them.
    """

    description: str
    limits: Limits
    name: str = ""
    ground_gray: Gray = 180
    sky_gray: Gray = 230
    randomised: bool = False
    start: Start = Start()
    line: Line | None = None
    patch: Annotated[tuple[Patch, ...], Meta(max_length=MAX_BOXES)] = ()
    tiles: Annotated[tuple[Tiles, ...], Meta(max_length=MAX_SCATTERS)] = ()
    box: Annotated[tuple[Box, ...], Meta(max_length=MAX_BOXES)] = ()
    mesh: Annotated[tuple[Mesh, ...], Meta(max_length=MAX_SCATTERS)] = ()
    along: Annotated[tuple[Along, ...], Meta(max_length=MAX_SCATTERS)] = ()
    area: Annotated[tuple[Area, ...], Meta(max_length=MAX_SCATTERS)] = ()

    def __post_init__(self) -> None:
        """Check what no single table can: raises `ValueError`, which loading turns into a `ConfigError`."""
        if self.line is None and self.along:
            raise ValueError("`along` scatters boxes along a line, and this world has no `line`")
        boxes = len(self.box) + sum(along.count for along in self.along) + sum(area.count for area in self.area)
        if boxes > MAX_BOXES:
            raise ValueError(f"{boxes} boxes are more than {MAX_BOXES}")
        closed = self.line is not None and self.line.closed
        if not closed and self.limits.finish_m is None:
            raise ValueError("limits.finish_m is needed unless the line is closed")
        if closed and self.limits.finish_m is not None:
            raise ValueError("limits.finish_m is for an open line; a closed one finishes after limits.laps")
