"""Everything that is known of a robot and of who drives it, as one value. Pure: times come in as arguments."""

import math
from dataclasses import dataclass

from lira.hal.bus.topics import OPERATOR_ANSWER, SESSION
from lira.hal.messages import (
    Applied,
    BatteryState,
    CompressedImage,
    CourseState,
    Decision,
    LaserScan,
    Odometry,
    OperatorAnswer,
    Request,
    SessionState,
)

STALE_S = 1.0
EMPTY_V, LOW_V, FULL_V = 10.2, 10.8, 12.6  # three lithium cells


@dataclass(frozen=True, slots=True)
class View:
    """What is known now. A part is None until it was heard; ages are in seconds since it was.

    `truth` is a twin's, `session` that of who teaches. `hand` is how the dead-man of
    who looks is (`deadman.State`), None without one.
    `answer` is whoever's who drives and learns, repeated by them, and `verdict_age_s` how long ago it was a new one;
    `unanswered` is a request of who looks that nobody answered.
    `lockstep`: it is there, and its time stands until whoever drives has answered.
    `other`: commands of who looks are refused, and somebody else drives.
    `confirmed`: the robot has answered that the emergency stop holds which was pressed here.
    """

    robot: str
    scan: LaserScan | None = None
    scan_age_s: float = float("inf")
    picture: CompressedImage | None = None
    picture_age_s: float = float("inf")
    odom: Odometry | None = None
    truth: CourseState | None = None
    truth_age_s: float = float("inf")
    applied: Applied | None = None
    link_age_s: float = float("inf")
    decision: Decision | None = None
    decision_age_s: float = float("inf")
    session: SessionState | None = None
    session_age_s: float = float("inf")
    battery: BatteryState | None = None
    answer: OperatorAnswer | None = None
    answer_age_s: float = float("inf")
    verdict_age_s: float = float("inf")
    unanswered: Request | None = None
    estop: bool = False
    confirmed: bool = False
    hand: str | None = None
    lockstep: bool = False
    other: bool = False
    fov_rad: float = 2.269
    max_range_m: float = 4.0

    @property
    def linked(self) -> bool:
        """Whether the robot is heard."""
        return self.applied is not None and self.link_age_s <= STALE_S

    @property
    def waiting(self) -> bool:
        """Whether it is there, in lockstep, and nobody drives it."""
        return self.lockstep and not self.linked

    @property
    def deciding(self) -> Decision | None:
        """The decision that holds now: None if nobody decides any more. Its counts outlive it."""
        return self.decision if self.decision_age_s < STALE_S else None

    @property
    def course(self) -> CourseState | None:
        """The twin's truth now, None where there is none."""
        return self.truth if self.truth_age_s < STALE_S else None

    @property
    def answering(self) -> OperatorAnswer | None:
        """The newest answer if somebody still takes requests."""
        return self.answer if self.answer_age_s <= OPERATOR_ANSWER.max_age_s else None

    @property
    def teaching(self) -> SessionState | None:
        """The session of teaching that goes on now; None where nobody holds one."""
        return self.session if self.session_age_s < SESSION.max_age_s else None

    @property
    def paused(self) -> bool:
        """Whether driving and learning wait for a person."""
        return self.answering is not None and self.answering.paused


def beams_ahead(scan: LaserScan, fov_rad: float, max_range_m: float) -> list[tuple[float, float]]:
    """What the learner sees of a scan: (angle in rad, distance in m) from right to left.

    No return is the full range; what is invalid is left out.
    """
    beams = []
    for index, distance_m in enumerate(scan.ranges.tolist()):
        angle = math.remainder(scan.angle_min + index * scan.angle_increment, 2 * math.pi)
        if abs(angle) <= fov_rad / 2 + 1e-6 and distance_m >= 0.0:
            beams.append((angle, min(distance_m, max_range_m)))
    return sorted(beams)


def battery_share(battery: BatteryState) -> float:
    """How full, in [0, 1], by voltage."""
    return min(1.0, max(0.0, (battery.voltage_v - EMPTY_V) / (FULL_V - EMPTY_V)))
