"""The HAL server in lockstep: step by step, in order, the same every time."""

import pytest
from wiring import PROFILE, joined, remote, served, wait_for

from lira.hal.bus.services import press_estop, release_estop
from lira.hal.bus.topics import APPLIED, CMD_VEL, IN_LOCKSTEP
from lira.hal.client.connect import open_remote
from lira.hal.client.remote import RemoteArena
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Command, Episode, Reason, Source, Twist
from lira.hal.testing import NullRobot

GO, TURN = Twist(0.5, 0.0), Twist(0.0, 0.5)


@pytest.fixture
def robot():
    with served(NullRobot(PROFILE), lockstep=True) as robot:
        yield robot


def policy(client, twist):
    return client.drive(Command(twist, client.now(), answers=client.read().seq))


def go_on(client):
    client.wait(client.now() + client.profile.period_s)


def test_time_waits_for_the_command_and_a_step_is_a_period(robot):
    with remote(robot) as client:
        times = []
        for _ in range(5):
            times.append(client.now())
            policy(client, STOP)
            assert client.now() == times[-1]  # until the client waits, it is in the same step
            go_on(client)
        assert times == pytest.approx([0.2 * step for step in range(5)])


def test_the_hand_that_was_put_before_policy_wins_its_step_and_no_other(robot):
    with remote(robot) as client:
        policy(client, STOP)
        go_on(client)
        for step in range(40):
            hand = step % 3 == 0
            if step % 3 < 2:
                seq, twist = client.read().seq, TURN if hand else STOP
                client.drive(Command(twist, client.now(), Source.TELEOP, seq, released=not hand))
            applied = policy(client, GO)
            assert (applied.twist, applied.source) == ((TURN, Source.TELEOP) if hand else (GO, Source.POLICY))
            assert applied.answers == client.read().seq
            go_on(client)


def test_an_emergency_stop_that_was_acknowledged_holds_in_the_step_that_is_answered_next(robot):
    with remote(robot) as client:
        policy(client, STOP)
        go_on(client)
        for _ in range(20):
            assert policy(client, GO).twist == GO
            go_on(client)
            press_estop(client.bus)
            assert policy(client, GO).reason is Reason.ESTOP
            go_on(client)
            release_estop(client.bus)
            for _ in range(2):  # what was in the step of the release does not count
                policy(client, STOP)
                go_on(client)


def test_two_runs_are_the_same():
    def log():
        with served(NullRobot(PROFILE), lockstep=True) as robot, remote(robot) as client:
            arena, lines = RemoteArena(client), []
            for step in range(30):
                observation = client.read()
                applied = policy(client, STOP if step == 0 else Twist(0.5, 0.1 * (step % 5)))
                lines.append((observation.seq, observation.stamp_s, repr(observation.odom), repr(applied)))
                go_on(client)
                if step % 10 == 9:
                    arena.reset(Episode(start_m=float(step)))
                    lines.append(repr((client.now(), arena.state())))
            return lines

    assert log() == log()


def test_a_step_is_answered_once(robot):
    with remote(robot) as client:
        seq = client.read().seq
        policy(client, STOP)
        with pytest.raises(BusError, match="wait"):
            client.drive(Command(GO, client.now(), answers=seq))
        go_on(client)
        with pytest.raises(BusError, match="no longer waited for"):
            client.drive(Command(GO, client.now(), answers=seq))
        with pytest.raises(BusError, match="time passes only with commands"):
            go_on(client)
        assert policy(client, GO).twist == GO


def test_a_command_without_an_observation_answers_the_next_one(robot):
    with remote(robot) as client:
        assert client.drive(Command(STOP, client.now())).reason is Reason.OK
        assert client.drive(Command(GO, client.now())).twist == GO
        assert client.now() == pytest.approx(PROFILE.period_s)


def test_commands_for_other_observations_are_not_obeyed(robot):
    with remote(robot) as client, joined(robot) as bus:
        policy(client, STOP)
        go_on(client)
        seq = client.read().seq
        stranger, applied = bus.publisher(CMD_VEL, IN_LOCKSTEP), bus.reader(APPLIED)
        wait_for(lambda: stranger.matching)
        for answers in (seq - 1, seq + 1, -1):
            stranger.put(GO, client.now(), answers=answers)
        assert policy(client, STOP).twist == STOP
        assert applied.newest() is None or applied.newest().message.twist == STOP


def test_a_client_that_comes_back_goes_on_where_time_stands(robot):
    with remote(robot) as client:
        for _ in range(3):
            policy(client, STOP)
            go_on(client)
        before = (client.read().seq, client.now())
    with remote(robot) as client:
        assert (client.read().seq, client.now()) == before
        policy(client, STOP)
        go_on(client)
        assert client.read().seq > before[0]


def test_a_robot_that_dies_is_said(robot, monkeypatch):
    monkeypatch.setattr("lira.hal.client.lockstep.ANSWER_S", 0.3)
    with remote(robot) as client:
        robot.stop.set()
        robot.join()
        with pytest.raises(BusError, match="has not answered"):
            policy(client, STOP)


def test_a_twin_that_refuses_to_reset_says_why():
    class Picky(NullRobot):
        def reset(self, episode):
            raise BusError("layout 9 does not exist", "Choose another.")

    with served(Picky(PROFILE), lockstep=True) as robot, remote(robot) as client:
        with pytest.raises(BusError, match="layout 9 does not exist"):
            RemoteArena(client).reset(Episode(layout=9))
        with pytest.raises(BusError, match="not an episode"):
            client.bus.ask("sim/reset", b"{")
        assert policy(client, STOP).reason is Reason.OK


def test_after_close_it_says_so(robot):
    with joined(robot) as bus:
        client = open_remote(bus)
        client.close()
        for asked in (client.now, client.read, client.state, lambda: client.drive(Command(STOP, 0.0))):
            with pytest.raises(BusError, match="closed"):
                asked()
