"""Step responses from odometry: how soon the robot moves, how fast, and how far it goes on after a stop. Pure."""

import math

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import Odometry
from lira.tools.parity.record import Recording, Span
from lira.tools.parity.script import SETTLED_S

Floats = NDArray[np.float64]

BEGUN, REACHED = 0.1, 0.9  # of the settled speed


def speeds(recording: Recording, name: str) -> tuple[Floats, Floats]:
    """Return capture times [n] and speeds [n] along the axis of a phase, m/s or rad/s, on the robot's clock."""
    turning = recording.span(name).phase.twist.angular_rad_s != 0.0
    odom = [heard.message for heard in recording.odom]
    values = [each.angular_rad_s if turning else each.linear_m_s for each in odom]
    return np.array([each.stamp_s for each in odom]), np.array(values, dtype=np.float64)


def settled(recording: Recording, name: str) -> float | None:
    """Mean speed over the end of a step, with its sign; None if the odometry says nothing then."""
    times_s, values = speeds(recording, name)
    end_s = recording.span(name).ended_s
    late = values[(times_s > end_s - SETTLED_S) & (times_s < end_s)]
    return float(late.mean()) if late.size else None


def delay_s(recording: Recording, name: str) -> float | None:
    """Time from the first command of a step to the first tenth of its speed."""
    return _crossing(recording, name, BEGUN)


def rise_s(recording: Recording, name: str) -> float | None:
    """Time from a tenth to nine tenths of the speed."""
    begun, reached = _crossing(recording, name, BEGUN), _crossing(recording, name, REACHED)
    return None if begun is None or reached is None else reached - begun


def halt_s(recording: Recording, name: str) -> float | None:
    """Time from the first stop command after a step until a tenth of its speed is left."""
    return _crossing(recording, name, BEGUN, after=True)


def halt_way(recording: Recording, name: str) -> float | None:
    """Metres or radians that the robot goes on after a step was stopped."""
    stop = recording.span(f"{name} stop")
    return _way(recording, stop.began_s, stop.ended_s, recording.span(name))


def way(recording: Recording, name: str) -> float | None:
    """Metres or radians from rest to rest."""
    step, stop = recording.span(name), recording.span(f"{name} stop")
    return _way(recording, step.began_s, stop.ended_s, step)


def turned_by_imu(recording: Recording, name: str) -> float | None:
    """Mean turn rate over the end of a step, rad/s, as the gyroscope has it; None without one."""
    end_s = recording.span(name).ended_s
    late = [heard.message.angular_rad_s for heard in recording.imu if end_s - SETTLED_S < heard.message.stamp_s < end_s]
    return float(np.mean(late)) if late else None


def _crossing(recording: Recording, name: str, share: float, *, after: bool = False) -> float | None:
    """Time from the start of a step until its speed rises over a share of the settled one, or falls below it after."""
    final = settled(recording, name)
    if not final:
        return None
    times_s, values = speeds(recording, name)
    span = recording.span(f"{name} stop") if after else recording.span(name)
    level = values / final
    before = (times_s > span.began_s - 0.2) & (times_s <= span.ended_s)
    times_s, level = times_s[before], level[before]
    reached = level <= share if after else level >= share
    reached &= times_s > span.began_s
    if not reached.any():
        return None
    at = int(reached.argmax())
    if at == 0 or level[at] == level[at - 1]:
        return float(times_s[at] - span.began_s)
    part = (share - level[at - 1]) / (level[at] - level[at - 1])
    crossed_s = times_s[at - 1] + np.clip(part, 0.0, 1.0) * (times_s[at] - times_s[at - 1])
    return max(float(crossed_s - span.began_s), 0.0)


def _way(recording: Recording, from_s: float, until_s: float, step: Span) -> float | None:
    odom = [heard.message for heard in recording.odom]
    if len(odom) < 2 or odom[0].stamp_s > until_s or odom[-1].stamp_s < from_s:
        return None
    if step.phase.twist.angular_rad_s != 0.0:
        yaw_rad = np.unwrap([each.yaw_rad for each in odom])
        start, end = _at(odom, yaw_rad, from_s), _at(odom, yaw_rad, until_s)
        return abs(end - start)
    x_m, y_m = (np.array([getattr(each, axis) for each in odom]) for axis in ("x_m", "y_m"))
    return math.hypot(*(_at(odom, values, until_s) - _at(odom, values, from_s) for values in (x_m, y_m)))


def _at(odom: list[Odometry], values: Floats, time_s: float) -> float:
    return float(np.interp(time_s, [each.stamp_s for each in odom], values))
