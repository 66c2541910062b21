"""Velocities and where they lead: Twist with and without a stamp, what was applied, odometry, IMU."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import Applied, Imu, Odometry, Reason, Source, Twist, TwistStamped
from lira.hal.messages.description import BASE, IMU_LINK, ODOM_FRAME
from lira.hal.messages.ros.types import Codec, Vector3, header, ros, stamp, twist_from, twist_to, yaw_from, yaw_to

_Point = ros("geometry_msgs/msg/Point")
_Pose = ros("geometry_msgs/msg/Pose")
_PoseWithCovariance = ros("geometry_msgs/msg/PoseWithCovariance")
_TwistWithCovariance = ros("geometry_msgs/msg/TwistWithCovariance")

UNMEASURED = 1e6  # variance of what nothing here measures: any value is as good
SIDEWAYS = 1e-4  # wheels do not slip to the side by more than a centimetre a second
# Nobody measures height, roll and pitch.
_POSE = np.diag([0.0, 0.0, UNMEASURED, UNMEASURED, UNMEASURED, 0.0]).reshape(-1)
_TWIST = np.diag([0.0, SIDEWAYS, UNMEASURED, UNMEASURED, UNMEASURED, 0.0]).reshape(-1)
# The gyroscope integrates the yaw; roll and pitch nobody knows. Gravity is what a level floor makes of it.
_IMU_ORIENTATION = np.diag([UNMEASURED, UNMEASURED, 0.1**2]).reshape(-1)
_IMU_TURN = np.diag([0.05**2, 0.05**2, 0.02**2]).reshape(-1)
_IMU_ACCELERATION = np.diag([0.2**2, 0.2**2, 0.5**2]).reshape(-1)
GRAVITY_M_S2 = 9.80665
_NO_COVARIANCE_36 = np.zeros(36)


def _stamped_to(m: TwistStamped) -> Any:
    return ros("geometry_msgs/msg/TwistStamped")(header(m.stamp_s, BASE), twist_to(m.twist))


def _stamped_from(message: Any) -> TwistStamped:
    return TwistStamped(stamp(message), twist_from(message.twist))


def _applied_to(m: Applied) -> Any:
    return ros("lira_msgs/msg/Applied")(
        header(m.stamp_s, BASE),
        twist_to(m.twist),
        m.source.value,
        m.reason.value,
        list(m.clamps),
        m.answers,
        m.command_age_s,
        m.session,
        m.seq,
        m.commander,
        m.field_cut_m_s,
    )


def _applied_from(message: Any) -> Applied:
    return Applied(
        twist_from(message.twist),
        stamp(message),
        Source(message.source),
        Reason(message.reason),
        tuple(message.clamps),
        message.answers,
        message.command_age_s,
        message.session,
        message.seq,
        message.commander,
        message.field_cut,
    )


def _odometry_to(m: Odometry) -> Any:
    pose = _Pose(_Point(m.x_m, m.y_m, 0.0), yaw_to(m.yaw_rad))
    twist = twist_to(Twist(m.linear_m_s, m.angular_rad_s))
    pose_covariance = twist_covariance = _NO_COVARIANCE_36
    if (spread := m.spread) is not None:
        pose_covariance = _covariance(_POSE, spread.position_m, spread.yaw_rad)
        pose_covariance[7] = pose_covariance[0]  # y as x
        twist_covariance = _covariance(_TWIST, spread.linear_m_s, spread.angular_rad_s)
    return ros("nav_msgs/msg/Odometry")(
        header(m.stamp_s, ODOM_FRAME),
        BASE,
        _PoseWithCovariance(pose, pose_covariance),
        _TwistWithCovariance(twist, twist_covariance),
    )


def _covariance(template: NDArray[np.float64], position: float, turn: float) -> NDArray[np.float64]:
    """Six by six, row by row, with nothing but the diagonal: what goes together with what, nobody knows."""
    matrix = template.copy()
    matrix[0], matrix[35] = position**2, turn**2
    return matrix


def _odometry_from(message: Any) -> Odometry:
    pose, twist = message.pose.pose, message.twist.twist
    return Odometry(
        stamp(message), pose.position.x, pose.position.y, yaw_from(pose.orientation), twist.linear.x, twist.angular.z
    )


def _imu_to(m: Imu) -> Any:
    return ros("sensor_msgs/msg/Imu")(
        header(m.stamp_s, IMU_LINK),
        yaw_to(m.yaw_rad),
        _IMU_ORIENTATION,
        Vector3(0.0, 0.0, m.angular_rad_s),
        _IMU_TURN,
        Vector3(m.linear_m_s2, m.lateral_m_s2, GRAVITY_M_S2),
        _IMU_ACCELERATION,
    )


def _imu_from(message: Any) -> Imu:
    acceleration = message.linear_acceleration
    return Imu(
        stamp(message), yaw_from(message.orientation), message.angular_velocity.z, acceleration.x, acceleration.y
    )


CODECS: dict[type, Codec] = {
    Twist: Codec("geometry_msgs/msg/Twist", twist_to, twist_from),
    TwistStamped: Codec("geometry_msgs/msg/TwistStamped", _stamped_to, _stamped_from),
    Applied: Codec("lira_msgs/msg/Applied", _applied_to, _applied_from),
    Odometry: Codec("nav_msgs/msg/Odometry", _odometry_to, _odometry_from),
    Imu: Codec("sensor_msgs/msg/Imu", _imu_to, _imu_from),
}
