"""A CORE2 board with ROSbot firmware as its line sees it: bytes in, bytes out, time handed in.

Source: the firmware's `main.cpp` and `config_functionality.cpp`, and its rosserial library.
"""

import math
import random
import struct
from collections.abc import Callable
from dataclasses import dataclass

from lira.hal.messages import STOP, Odometry, Twist
from lira.sim_backend.emulators.rosserial import Reader, encode, header, log, pack_string, topic_info, unpack_string

BOOT_S = 2.0
BOOT_TEXT = b"\x00\xffrosbot firmware 0.16.2\r\n" + bytes(range(0x80, 0xFF))
RING_SIZE = 768  # what comes while nobody reads waits in the serial port; what exceeds it is lost
WATCHDOG_S = 1.0
DRIVE_S = 0.01  # its regulators work so often; a target is repeated to the wheels
ASK_TIME_S = 2.5
GIVE_UP_S = 11.0  # without an answer to the question for the time
POSE_S, SLOW_S, BATTERY_S = 0.05, 0.1, 0.4
VOLTAGE_V = 11.7
GRAVITY_M_S2 = 9.81
WHEEL_RADIUS_M = 0.0425
WHEELS = tuple(f"{place}_wheel_hinge" for place in ("front_left", "front_right", "rear_left", "rear_right"))
BANNER = "rosbot firmware 0.16.2".ljust(386, "*")  # 391 bytes with its level and length
INFO, ERROR = 1, 3

# Ids count from here in the order in which the firmware makes its subscribers and publishers: `config` comes first.
FIRST_SUBSCRIBED, FIRST_PUBLISHED = 100, 125
CONFIG = ("rosbot_ekf/Configuration", "b116973260063b7b02b501a288810d3d", "d26ad64e1f52355ee24245b602a171ba")
PUBLISHED = {
    "battery": ("sensor_msgs/BatteryState", "4ddae7f048e32fda22cac764685e3974"),
    "pose": ("geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5"),
    "velocity": ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
    "range/fr": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "range/fl": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "range/rr": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "range/rl": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "joint_states": ("sensor_msgs/JointState", "3066dcd76a6cfaef579bd0f34173e9fd"),
    "imu": ("sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    "buttons": ("std_msgs/UInt8", "7c8164229e7d2c17eb95e9231617fdee"),
}
SUBSCRIBED = {
    "cmd_vel": ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
    "cmd_ser": ("std_msgs/UInt32", "304a39449588c7f8ce2df6e8001c5fce"),
}
PERIODS_S = dict.fromkeys(PUBLISHED, SLOW_S) | dict.fromkeys(("pose", "velocity", "joint_states"), POSE_S)
PERIODS_S["battery"] = BATTERY_S
del PERIODS_S["buttons"]  # only when pressed

OK, FAILURE, UNKNOWN = 0, 1, 2
# What the words of `config` need as their data, for it to be accepted; what is not here the firmware has no word for.
NUMBERS = {"EWCH": 1, "EMOT": 0, "EJSM": 1, "EIMU": 1, "ETFM": 1, "SLED": 2, "CALI": 2, "CPID": 0, "CSER": 0}
NUMBERS |= {"RODOM": 0, "SANI": 0, "GPID": 0, "SKIN": 0, "GKIN": 0}
REFUSED = ("RIMU", "EDSE")  # known, and not implemented
PID = "kp:0.800 ki:0.200 kd:0.015 out_max:0.800 out_min:-0.800 a_max:1.500e+00 speed_max: 1.000"

Drive = Callable[[Twist], None]
Measure = Callable[[], Odometry]


@dataclass(frozen=True, slots=True)
class Firmware:
    """What differs between boards. `md5s` overrides an announced topic's."""

    baud: int = 525000
    boot_s: float = BOOT_S
    kinematics: str = "DIFF"  # or MEC: the image for mecanum wheels
    md5s: tuple[tuple[str, str], ...] = ()


class Core2Unit:
    """The board. `receive` takes what the host sent, `emit` gives what is due. `drive` and `measure` are the wheels.

    The ramp of its wheels is the caller's: the twin has it. An id that it never announced makes the real board jump to
    wherever the memory says: here it `crashed` for good.
    """

    def __init__(self, drive: Drive, measure: Measure, firmware: Firmware | None = None, seed: int = 0) -> None:
        self._drive = drive
        self._measure = measure
        self.firmware = firmware or Firmware()
        self.baud = self.firmware.baud
        self._random = random.Random(seed)
        self.crashed = False
        self.config_request_id, self.config_answer_id = FIRST_SUBSCRIBED, FIRST_PUBLISHED
        self.subscribed = {name: FIRST_SUBSCRIBED + 1 + i for i, name in enumerate(SUBSCRIBED)}
        self.published = {name: FIRST_PUBLISHED + 1 + i for i, name in enumerate(PUBLISHED)}
        self.reset()

    def reset(self, boot_s: float | None = None) -> None:
        """Press the board's reset button, also in mid drive: it stops, forgets its host, and boots for `boot_s`.

        What comes meanwhile waits in the serial port, and is obeyed once it has booted: ids belong to no session.
        """
        self._boot_s = self.firmware.boot_s if boot_s is None else boot_s
        self._started_s: float | None = None
        self._booted = False
        self._ring = b""
        self._reader = Reader()
        self._output = b""
        self.configured = False
        self.watchdog = self.motors = True
        self.joint_states = False
        self.kinematics = self.firmware.kinematics
        self.target = STOP
        self.obeyed_unannounced = 0  # commands that came when it ran again and had announced nothing
        self.commanded_s = -math.inf
        self._driven, self._drive_again_s = STOP, -math.inf
        self._clock_s: float | None = None  # the host's time less ours
        self._asked_s = self._answered_s = -math.inf
        self._due_s = dict.fromkeys(PERIODS_S, -math.inf)

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes. A frame that comes too slowly is lost."""
        if self.crashed:
            return
        if self._booting(now_s):
            self._ring = (self._ring + data)[:RING_SIZE]
            return
        for topic, payload in self._reader.read(data, now_s):
            if not self.configured and topic == self.subscribed["cmd_vel"]:
                self.obeyed_unannounced += 1
            self._obey(topic, payload, now_s)
        self.crashed |= self._reader.overrun

    def emit(self, now_s: float) -> bytes:
        """Return what is due, and let the watchdog strike."""
        if self.crashed:
            return b""
        if self._booting(now_s):
            garbage = BOOT_TEXT[self._random.randrange(len(BOOT_TEXT)) :]
            return garbage if self._random.random() < 0.02 else b""
        if self.watchdog and now_s - self.commanded_s > WATCHDOG_S and self.target != STOP:
            self.target = STOP
        target = self.target if self.motors else STOP
        if target != self._driven or now_s >= self._drive_again_s:
            self._driven, self._drive_again_s = target, now_s + DRIVE_S
            self._drive(target)
        if self.configured:
            self._keep_in_touch(now_s)
            self._publish(now_s)
        output, self._output = self._output, b""
        return output

    def press(self, button: int) -> None:
        """Press button 1 or 2."""
        if self.configured:
            self._send(self.published["buttons"], bytes([button]))

    def _booting(self, now_s: float) -> bool:
        """Whether it still boots; once it has, it obeys at once all that has come meanwhile."""
        if self._started_s is None:
            self._started_s = now_s
            self._drive(STOP)
        if now_s - self._started_s < self._boot_s:
            return True
        if not self._booted:
            self._booted = True
            self._log(ERROR, "VL53L0X sensros initialisation failure!")  # also before anybody has asked for topics
            for frame in self._reader.read(self._ring, now_s):
                self._obey(*frame, now_s)
        return False

    def _obey(self, topic: int, payload: bytes, now_s: float) -> None:
        if topic == 0:
            self.configured = True
            self._answered_s = now_s
            self._ask_time(now_s)
            self._announce()
        elif topic == 10:
            sec, nsec = struct.unpack("<II", payload)
            # It adds all the time since it asked: a question that was heard late sets its clock ahead.
            self._clock_s, self._answered_s = sec + nsec * 1e-9 - max(self._asked_s, 0.0), now_s
        elif topic == 11:
            self.configured = False
        elif topic == self.subscribed["cmd_vel"]:
            linear, angular = struct.unpack_from("<d", payload)[0], struct.unpack_from("<d", payload, 40)[0]
            self.target, self.commanded_s = Twist(linear, angular), now_s
        elif topic == self.config_request_id:
            word, rest = unpack_string(payload)
            result, answer = self._configure(word, unpack_string(rest)[0])
            if self.configured:
                self._send(self.config_answer_id, pack_string(answer) + bytes([result]))
        elif topic not in self.subscribed.values():
            self.crashed = True

    def _configure(self, word: str, data: str) -> tuple[int, str]:
        """Result and data of a call."""
        if word in REFUSED:
            return FAILURE, ""
        if word not in NUMBERS:
            return UNKNOWN, ""
        numbers = data.split()
        if len(numbers) < NUMBERS[word] or (word == "SKIN" and data not in ("DIFF", "MEC")):
            return FAILURE, ""
        if word == "EWCH":
            self.watchdog = numbers[0] != "0"
        elif word == "EMOT":
            self.motors = numbers[:1] not in ([], ["0"])
            self.target = STOP  # the regulators begin anew: it stands until the next command
            self._log(INFO, "Motors connected." if self.motors else "Motors disconnected.")
        elif word == "EJSM":
            self.joint_states = numbers[0] != "0"
        elif word == "SKIN":
            self.kinematics = data
        return OK, {"GKIN": self.kinematics, "GPID": PID}.get(word, "")

    def _announce(self) -> None:
        changed = dict(self.firmware.md5s)
        kind, request_md5, answer_md5 = CONFIG
        self._send(2, topic_info(self.config_answer_id, "config", kind, answer_md5))
        for name, (published, md5) in PUBLISHED.items():
            self._send(0, topic_info(self.published[name], name, published, changed.get(name, md5)))
        self._send(3, topic_info(self.config_request_id, "config", kind, request_md5))
        for name, (subscribed, md5) in SUBSCRIBED.items():
            self._send(1, topic_info(self.subscribed[name], name, subscribed, changed.get(name, md5)))
        self._log(INFO, BANNER)

    def _keep_in_touch(self, now_s: float) -> None:
        if now_s - self._answered_s > GIVE_UP_S:
            self.configured = False
        elif now_s - self._asked_s > ASK_TIME_S:
            self._ask_time(now_s)

    def _ask_time(self, now_s: float) -> None:
        self._asked_s = now_s
        self._send(10, bytes(8))

    def _publish(self, now_s: float) -> None:
        odom = self._measure()
        for name, period_s in PERIODS_S.items():
            if now_s >= self._due_s[name] and (name != "joint_states" or self.joint_states):
                self._due_s[name] = max(self._due_s[name] + period_s, now_s + period_s / 2)
                self._send(self.published[name], self._payload(name, odom, now_s))

    def _payload(self, name: str, odom: Odometry, now_s: float) -> bytes:
        stamp_s = now_s + (self._clock_s or 0.0)
        facing = struct.pack("<4d", 0.0, 0.0, math.sin(odom.yaw_rad / 2), math.cos(odom.yaw_rad / 2))
        if name == "pose":
            return header(stamp_s, "odom") + struct.pack("<3d", odom.x_m, odom.y_m, 0.0) + facing
        if name == "velocity":
            yaw_rad = odom.yaw_rad if self.kinematics == "DIFF" else 0.0  # in the odom frame, or in the body's
            east, north = odom.linear_m_s * math.cos(yaw_rad), odom.linear_m_s * math.sin(yaw_rad)
            return struct.pack("<6d", east, north, 0.0, 0.0, 0.0, odom.angular_rad_s)
        if name == "imu":
            rates = struct.pack("<3d", 0.0, 0.0, odom.angular_rad_s)
            lateral = odom.linear_m_s * odom.angular_rad_s
            forces = struct.pack("<3d", 0.0, lateral, GRAVITY_M_S2)
            return header(stamp_s, "imu_link") + facing + bytes(72) + rates + bytes(72) + forces + bytes(72)
        if name == "battery":
            unknown = struct.pack("<6f", *[math.nan] * 6)
            return header(stamp_s, "") + struct.pack("<f", VOLTAGE_V) + unknown + b"\0\0\2\1" + bytes(16)
        if name == "joint_states":
            turned = struct.pack("<I4d", len(WHEELS), *[odom.x_m / WHEEL_RADIUS_M] * len(WHEELS))
            names = struct.pack("<I", len(WHEELS)) + b"".join(map(pack_string, WHEELS))
            return header(stamp_s, "base_link") + names + turned + bytes(8)
        frame = name.replace("/", "_")
        return header(stamp_s, frame) + struct.pack("<B4f", 1, 0.26, 0.03, 0.90, -1.0)

    def _log(self, level: int, text: str) -> None:
        self._send(7, log(level, text))

    def _send(self, topic: int, payload: bytes) -> None:
        self._output += encode(topic, payload)
