"""A CORE2 board with ROSbot firmware as its line sees it: bytes in, bytes out, time handed in."""

import math
import random
import struct
from collections.abc import Callable
from dataclasses import dataclass

from hal.messages import STOP, Odometry, Twist

BOOT_S = 2.0
BOOT_TEXT = b"\x00\xffrosbot firmware 0.16.2\r\n" + bytes(range(0x80, 0xFF))
BUFFER_SIZE = 512
FRAME_S = 0.02  # a frame has to arrive within
WATCHDOG_S = 1.0
DRIVE_S = 0.1  # a target is repeated to the wheels, which may have a watchdog of their own
ASK_TIME_S = 2.5
GIVE_UP_S = 11.0  # without an answer to the question for the time
POSE_S, SLOW_S, BATTERY_S = 0.05, 0.1, 0.4
VOLTAGE_V = 11.7
GRAVITY_M_S2 = 9.81

FIRST_ID = 100
PUBLISHED = {
    "battery": ("sensor_msgs/BatteryState", "4ddae7f048e32fda22cac764685e3974"),
    "pose": ("geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5"),
    "velocity": ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
    "range/fr": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "range/fl": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "range/rr": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "range/rl": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    "imu": ("sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    "buttons": ("std_msgs/UInt8", "7c8164229e7d2c17eb95e9231617fdee"),
}
SUBSCRIBED = {
    "cmd_ser": ("std_msgs/UInt32", "304a39449588c7f8ce2df6e8001c5fce"),
    "cmd_vel": ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
}
CONFIG = ("rosbot_ekf/Configuration", "b116973260063b7b02b501a288810d3d", "d26ad64e1f52355ee24245b602a171ba")
OK, UNKNOWN = 0, 2

Drive = Callable[[Twist], None]
Measure = Callable[[], Odometry]


@dataclass(frozen=True, slots=True)
class Firmware:
    """What differs between boards. `md5s` overrides an announced topic's."""

    baud: int = 525000
    boot_s: float = BOOT_S
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
        self.published = {name: FIRST_ID + 25 + i for i, name in enumerate(PUBLISHED)}
        self.subscribed = {name: FIRST_ID + i for i, name in enumerate(SUBSCRIBED)}
        self.config_id = FIRST_ID + len(SUBSCRIBED)
        self._started_s: float | None = None
        self.reset()

    def reset(self) -> None:
        """Press the board's reset button: it stops, forgets its host, and boots."""
        self._started_s = None
        self._input = b""
        self._input_s = 0.0
        self._output = b""
        self.configured = False
        self.watchdog = False
        self.motors = True
        self.target = STOP
        self._commanded_s = -math.inf
        self._driven, self._drive_again_s = STOP, -math.inf
        self._clock_s: float | None = None  # the host's time less ours
        self._asked_s = self._answered_s = -math.inf
        self._due_s = dict.fromkeys(PUBLISHED, -math.inf)

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes; what exceeds the buffer is lost, and so is a frame that comes too slowly."""
        if self._booting(now_s) or self.crashed:
            return
        if self._input and now_s - self._input_s > FRAME_S:
            self._input = b""
        self._input_s = now_s
        self._input += data
        while (frame := self._take_frame()) is not None:
            self._obey(*frame, now_s)
        self._input = self._input[-BUFFER_SIZE:]

    def emit(self, now_s: float) -> bytes:
        """Return what is due, and let the watchdog strike."""
        if self.crashed:
            return b""
        if self._booting(now_s):
            garbage = BOOT_TEXT[self._random.randrange(len(BOOT_TEXT)) :]
            return garbage if self._random.random() < 0.02 else b""
        if self.watchdog and now_s - self._commanded_s > WATCHDOG_S and self.target != STOP:
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

    def _booting(self, now_s: float) -> bool:
        if self._started_s is None:
            self._started_s = now_s
            self._drive(STOP)
        return now_s - self._started_s < self.firmware.boot_s

    def _take_frame(self) -> tuple[int, bytes] | None:
        """Take the next whole frame off the input, as the firmware's state machine does."""
        while True:
            start = self._input.find(b"\xff\xfe")
            if start < 0:
                self._input = self._input[-1:]
                return None
            self._input = self._input[start:]
            if len(self._input) < 8:
                return None
            size = struct.unpack_from("<H", self._input, 2)[0]
            sound = (sum(self._input[2:4]) + self._input[4]) % 256 == 255 and size <= BUFFER_SIZE
            if sound and len(self._input) < size + 8:
                return None
            if sound and sum(self._input[5 : size + 8]) % 256 == 255:
                topic = struct.unpack_from("<H", self._input, 5)[0]
                payload, self._input = self._input[7 : size + 7], self._input[size + 8 :]
                return topic, payload
            self._input = self._input[2:]

    def _obey(self, topic: int, payload: bytes, now_s: float) -> None:
        if topic == 0:
            self.configured = True
            self._answered_s = now_s
            self._ask_time(now_s)
            self._announce()
        elif topic == 10:
            sec, nsec = struct.unpack("<II", payload)
            self._clock_s, self._answered_s = sec + nsec * 1e-9 - now_s, now_s
        elif topic == 11:
            self.configured = False
        elif topic == self.subscribed["cmd_vel"]:
            linear, angular = struct.unpack_from("<d", payload)[0], struct.unpack_from("<d", payload, 40)[0]
            self.target, self._commanded_s = Twist(linear, angular), now_s
        elif topic == self.config_id:
            self._configure(payload)
        elif topic not in self.subscribed.values():
            self.crashed = True

    def _configure(self, payload: bytes) -> None:
        command, rest = unpack_string(payload)
        data, _ = unpack_string(rest)
        result = OK
        if command == "EWCH":
            self.watchdog = data == "1"
        elif command == "EMOT":
            self.motors = data == "1"
        elif command not in ("EJSM", "EIMU", "CALI", "CPID", "SKIN"):
            result = UNKNOWN
        self._send(self.config_id, pack_string("") + bytes([result]))

    def _announce(self) -> None:
        changed = dict(self.firmware.md5s)
        for name, (kind, md5) in PUBLISHED.items():
            self._send(0, topic_info(self.published[name], name, kind, changed.get(name, md5)))
        kind, request_md5, answer_md5 = CONFIG
        self._send(2, topic_info(self.config_id, "config", kind, answer_md5))
        self._send(3, topic_info(self.config_id, "config", kind, request_md5))
        for name, (kind, md5) in SUBSCRIBED.items():
            self._send(1, topic_info(self.subscribed[name], name, kind, changed.get(name, md5)))

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
        for name in PUBLISHED:
            period_s = POSE_S if name in ("pose", "velocity") else BATTERY_S if name == "battery" else SLOW_S
            if now_s >= self._due_s[name]:
                self._due_s[name] = max(self._due_s[name] + period_s, now_s + period_s / 2)
                self._send(self.published[name], self._payload(name, odom, now_s))

    def _payload(self, name: str, odom: Odometry, now_s: float) -> bytes:
        stamp_s = now_s + (self._clock_s or 0.0)
        facing = struct.pack("<4d", 0.0, 0.0, math.sin(odom.yaw_rad / 2), math.cos(odom.yaw_rad / 2))
        if name == "pose":
            return header(stamp_s, "odom") + struct.pack("<3d", odom.x_m, odom.y_m, 0.0) + facing
        if name == "velocity":
            east, north = odom.linear_m_s * math.cos(odom.yaw_rad), odom.linear_m_s * math.sin(odom.yaw_rad)
            return struct.pack("<6d", east, north, 0.0, 0.0, 0.0, odom.angular_rad_s)
        if name == "imu":
            rates = struct.pack("<3d", 0.0, 0.0, odom.angular_rad_s)
            lateral = odom.linear_m_s * odom.angular_rad_s
            forces = struct.pack("<3d", 0.0, lateral, GRAVITY_M_S2)
            return header(stamp_s, "imu_link") + facing + bytes(72) + rates + bytes(72) + forces + bytes(72)
        if name == "battery":
            unknown = struct.pack("<6f", *[math.nan] * 6)
            return header(stamp_s, "") + struct.pack("<f", VOLTAGE_V) + unknown + b"\0\0\2\1" + bytes(16)
        if name == "buttons":
            return b"\0"
        frame = name.replace("/", "_")
        return header(stamp_s, frame) + struct.pack("<B4f", 1, 0.26, 0.03, 0.90, -1.0)

    def _send(self, topic: int, payload: bytes) -> None:
        size, body = struct.pack("<H", len(payload)), struct.pack("<H", topic) + payload
        checks = [255 - sum(part) % 256 for part in (size, body)]
        self._output += b"\xff\xfe" + size + bytes(checks[:1]) + body + bytes(checks[1:])


def header(stamp_s: float, frame: str) -> bytes:
    """std_msgs/Header of ROS 1."""
    nanoseconds = int(max(stamp_s, 0.0) * 1e9)
    return struct.pack("<III", 0, nanoseconds // 10**9, nanoseconds % 10**9) + pack_string(frame)


def topic_info(number: int, name: str, kind: str, md5: str) -> bytes:
    """rosserial_msgs/TopicInfo."""
    texts = b"".join(pack_string(text) for text in (name, kind, md5))
    return struct.pack("<H", number) + texts + struct.pack("<i", BUFFER_SIZE)


def pack_string(text: str) -> bytes:
    """Length and bytes."""
    return struct.pack("<I", len(text)) + text.encode("ascii")


def unpack_string(data: bytes) -> tuple[str, bytes]:
    """Return the text and what follows it."""
    size = struct.unpack_from("<I", data)[0]
    return data[4 : 4 + size].decode("ascii"), data[4 + size :]
