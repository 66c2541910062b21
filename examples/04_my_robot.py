"""A robot of your own: seven members, and all that drives the ROSbot drives it.

From a shell: lira robot --driver examples/04_my_robot.py:Rover --profile thesis-sim
"""

import time

import lira


class Rover:
    """Goes straight, exactly as told. What it has not got stays None in the observation."""

    def __init__(self, profile: lira.RobotProfile) -> None:
        self.profile, self.now = profile, time.monotonic  # the clock is the robot's: all stamps are on it
        self.x_m, self.speed_m_s, self.since_s, self.seq = 0.0, 0.0, self.now(), 0

    def open(self) -> None: ...  # bring the devices up
    def close(self) -> None: ...  # stop the wheels, let go of the devices
    def wait(self, until_s: float) -> None:
        time.sleep(max(until_s - self.now(), 0.0))

    def drive(self, command: lira.Command) -> lira.Applied:  # to the motors; return what they really got
        self.x_m, self.since_s = self.x_m + self.speed_m_s * (self.now() - self.since_s), self.now()
        self.speed_m_s = command.twist.linear_m_s
        return lira.Applied(command.twist, self.now(), command.source, lira.Reason.OK, (), command.answers)

    def read(self) -> lira.Observation:
        self.seq += 1
        odom = lira.Odometry(self.now(), self.x_m, 0.0, 0.0, self.speed_m_s, 0.0)
        return lira.Observation(self.seq, self.now(), odom=odom)  # and scan, image, imu, battery, ranges


if __name__ == "__main__":
    with lira.govern(Rover(lira.load_profile("thesis-sim"))) as robot:
        for speed in (0.0, 0.5, 0.5, 9.0):  # a stopped robot moves after a neutral command only
            applied = robot.drive(lira.Command(lira.Twist(speed, 0.0), robot.now()))
            robot.wait(robot.now() + 0.2)
            print(f"asked for {speed} m/s, got {applied.twist.linear_m_s} {applied.clamps}, at {robot.read().odom}")
