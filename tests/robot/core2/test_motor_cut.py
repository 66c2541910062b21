"""The emergency stop, pressed on the bus, reaches the motors' power in the board's firmware."""

import threading
import time
from contextlib import closing, contextmanager

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import press_estop, release_estop
from lira.hal.bus.topics import ESTOP
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Bool, Command, Odometry, Reason, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.robot.core2.config_calls import AGAIN_S, Errands
from lira.robot.rosbot import Devices, Rosbot
from lira.robot.settings import BaseSettings, Settings
from lira.sim_backend.emulators.core2 import Core2Unit, Firmware
from lira.sim_backend.emulators.wire import Wire
from lira.tools.launch.processes import free_port

PROFILE = load_profile("thesis-sim")
SETTINGS = Settings(base=BaseSettings(boot_s=0.1))
GO = Twist(0.3, 0.0)


class Wheels:
    """Wheels that obey at once, and remember what they did when the power went."""

    def __init__(self):
        self.twist = STOP

    def drive(self, twist):
        self.twist = twist

    def measure(self):
        return Odometry(0.0, 0.0, 0.0, 0.0, self.twist.linear_m_s, self.twist.angular_rad_s)


@contextmanager
def base_on_the_bus(path):
    """A base behind its wire and the HAL server; yields the board, its wheels, the wire, and a client."""
    wheels = Wheels()
    board = Core2Unit(wheels.drive, wheels.measure, Firmware(boot_s=0.05))
    wire = Wire(path, board)
    port, stop = free_port(), threading.Event()
    name, endpoint = f"estop_{port}", f"127.0.0.1:{port}"
    served = Bus(name, listen=endpoint)
    robot = GovernedRobot(Rosbot(PROFILE, Devices(str(path), settings=SETTINGS)))
    server = threading.Thread(target=HalServer(robot, served).run, args=(stop,))
    server.start()
    bus = Bus(name, connect=endpoint)
    try:
        with closing(open_remote(bus, answer_s=10.0)) as client:
            yield board, wheels, wire, client
    finally:
        stop.set()
        server.join(10.0)
        assert bus.close()
        assert served.close()
        wire.close()


def wait_for(condition, timeout_s=5.0):
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.005)


def drive_until(client, twist, wanted):
    wait_for(lambda: wanted(client.drive(Command(twist, client.now()))))


def get_going(client, wheels):
    drive_until(client, STOP, lambda applied: applied.reason is Reason.OK)
    drive_until(client, GO, lambda applied: applied.twist == GO)
    wait_for(lambda: wheels.twist == GO)


def test_pressed_on_the_bus_it_cuts_the_motors_and_the_release_gives_them_back(tmp_path):
    with base_on_the_bus(tmp_path / "core2") as (board, wheels, _, client):
        get_going(client, wheels)
        assert board.motors
        assert press_estop(client.bus).pressed
        wait_for(lambda: wheels.twist == STOP, 0.3)
        assert board.motors  # they brake first
        wait_for(lambda: not board.motors, 1.0)
        assert release_estop(client.bus).state == "stopped"
        wait_for(lambda: board.motors, 1.0)
        drive_until(client, GO, lambda applied: applied.reason is Reason.NEUTRAL_FIRST)
        assert wheels.twist == STOP
        get_going(client, wheels)


def test_a_ros_peers_button_cuts_them_and_a_board_that_restarts_learns_it_again(tmp_path):
    with base_on_the_bus(tmp_path / "core2") as (board, wheels, _, client):
        get_going(client, wheels)
        client.bus.publisher(ESTOP).put(Bool(True), 0.0)
        wait_for(lambda: not board.motors, 2.0)
        board.firmware = Firmware(boot_s=1.1)
        board.reset()
        assert board.motors
        wait_for(lambda: not board.motors, 6.0)
        assert wheels.twist == STOP
        assert not board.crashed


def test_a_line_that_loses_bytes_only_delays_it(tmp_path):
    with base_on_the_bus(tmp_path / "core2") as (board, wheels, wire, client):
        get_going(client, wheels)
        wire.loss = 0.02  # of what the board says: its answers get lost
        for _ in range(3):
            press_estop(client.bus)
            wait_for(lambda: not board.motors)
            release_estop(client.bus)
            wait_for(lambda: board.motors)


def test_a_call_is_repeated_until_it_is_answered_and_the_next_waits_for_it():
    errands = Errands()
    said = []

    def calls(now_s):
        said.clear()
        errands.due(now_s, lambda *texts: said.append(texts) or b"")
        return said[:]

    errands.want("EWCH", "1")
    errands.want("EMOT", "0")
    assert calls(0.0) == [("EWCH", "1")]
    assert calls(AGAIN_S / 2) == []
    assert calls(AGAIN_S) == [("EWCH", "1")]
    assert errands.unanswered_s(2 * AGAIN_S) == 2 * AGAIN_S  # since the first try
    errands.answered()
    assert errands.unanswered_s(9.0) == 0.0
    assert calls(AGAIN_S) == [("EMOT", "0")]
    errands.want("EMOT", "1")  # the newest wish counts, whatever the answer to the old one is
    errands.answered()
    assert calls(AGAIN_S) == [("EMOT", "1")]
    errands.answered()
    assert calls(9.0) == []
    errands.answered()  # late answer of a call that was repeated
    errands.want("EMOT", "0")
    assert calls(9.0) == [("EMOT", "0")]
    errands.forget()
    assert calls(20.0) == []
