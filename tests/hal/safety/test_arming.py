"""Who may set a robot in motion: over any sequence of commands, losses, obstacles and presses, and case by case."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lira.hal.messages import STOP, Applied, Command, Reason, Source, Twist, is_neutral, session_of
from lira.hal.port import DeviceHealth
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.testing import NullRobot

ROSBOT = load_profile("rosbot2")
GO = Twist(0.2, 0.0)
P, T = Source.POLICY, Source.TELEOP
TICK_S = 0.02
DRIVING = (Reason.OK, Reason.OBSTACLE)
NEAR_M = 0.157  # from the lidar: inside the field's stop distance


class Fallible(NullRobot):
    """A robot that loses devices and sees an obstacle, as it is told."""

    def __init__(self):
        super().__init__(ROSBOT)
        self.lost, self.losses, self.blocked, self.silent = (), 0, False, False
        self.shown = None

    def device_health(self):
        return DeviceHealth(self.lost, self.losses)

    def read(self):
        seen = super().read()
        if not self.silent:
            ranges = np.full(ROSBOT.lidar.beams, NEAR_M if self.blocked else math.inf, np.float32)
            self.shown = replace(seen.scan, ranges=ranges)
        return replace(seen, scan=self.shown)

    def lose(self, *names):
        self.lost, self.losses = names, self.losses + 1

    def find(self):
        self.lost = ()


class Floor:
    """A governed robot as the server drives it: it is read, and ticked at 50 Hz."""

    def __init__(self):
        self.inner = Fallible()
        self.robot = GovernedRobot(self.inner)
        self.robot.read()

    def say(self, twist, source=P, *, epoch=1, released=False):
        self.robot.submit(Command(twist, self.robot.now(), source, released=released, epoch=epoch))
        return self.robot.tick()

    def stream(self, seconds, *wishes):
        """Say all wishes again and again, in order; returns everything that was applied."""
        applied = []
        for _ in range(round(seconds / TICK_S)):
            self.robot.read()
            applied += [self.say(*wish[:2], **wish[2]) for wish in wishes] or [self.robot.tick()]
            self.robot.wait(self.robot.now() + TICK_S)
        return applied

    def driving(self):
        self.stream(0.1, policy(STOP))
        assert self.stream(0.5, policy(GO))[-1].twist == GO
        return self

    def stands(self, seconds, *wishes):
        """Whether nothing moves all the while; the last reason."""
        applied = self.stream(seconds, *wishes)
        assert {each.twist for each in applied} == {STOP}
        return applied[-1].reason


def policy(twist, **more):
    return twist, P, more


def hand(twist, **more):
    return twist, T, {"epoch": 2} | more


def bare_hand(twist):
    """A ROS peer on `cmd_vel/teleop`, as the inlet takes it."""
    return twist, T, {"epoch": 0, "released": is_neutral(twist)}


def test_an_obstacle_that_comes_and_goes_does_not_arm_a_robot_that_lost_a_device():
    floor = Floor().driving()
    floor.inner.lose("base")
    applied = floor.stream(0.5, policy(GO))
    assert {each.twist for each in applied} == {STOP}
    assert (applied[-1].reason, applied[-1].clamps) == (Reason.STALE, ("no_base",))
    floor.inner.find()
    assert floor.stands(0.3, policy(GO)) is Reason.NEUTRAL_FIRST
    floor.inner.blocked = True
    assert floor.stands(1.0, policy(GO)) is Reason.NEUTRAL_FIRST
    floor.inner.blocked = False
    assert floor.stands(1.0, policy(GO)) is Reason.NEUTRAL_FIRST
    floor.driving()


def test_a_lidar_that_is_back_while_the_field_is_still_blind_does_not_set_it_off():
    floor = Floor().driving()
    floor.inner.silent = True
    floor.inner.lose("lidar")
    floor.stands(1.5, policy(GO))
    floor.inner.find()  # the scan is there, and the field has not seen it yet
    assert floor.say(GO).reason is Reason.NEUTRAL_FIRST
    floor.inner.silent = False
    assert floor.stands(1.0, policy(GO)) is Reason.NEUTRAL_FIRST
    floor.driving()


def test_a_field_that_stops_it_while_a_device_is_lost_leaves_it_unarmed_when_both_are_over():
    floor = Floor().driving()
    floor.inner.blocked = True
    assert floor.stream(0.3, policy(GO))[-1].reason is Reason.OBSTACLE
    floor.inner.lose("camera")
    floor.stands(0.2, policy(GO))
    floor.inner.blocked = False
    floor.stands(0.2, policy(GO))
    floor.inner.find()
    assert floor.stands(0.5, policy(GO)) is Reason.NEUTRAL_FIRST


def test_a_loss_shorter_than_a_tick_stops_it_too():
    floor = Floor().driving()
    floor.inner.lose("base")
    floor.inner.find()
    assert floor.stands(0.5, policy(GO)) is Reason.NEUTRAL_FIRST
    floor.driving()


def test_a_zero_while_a_device_is_lost_does_not_arm_for_later():
    floor = Floor().driving()
    floor.inner.lose("lidar", "base")
    applied = floor.stream(0.3, policy(STOP), hand(STOP))
    assert (applied[-1].reason, applied[-1].clamps) == (Reason.STALE, ("no_lidar", "no_base"))
    floor.inner.find()
    assert floor.stands(0.3, hand(STOP, released=True), policy(GO)) is Reason.NEUTRAL_FIRST


def test_a_zero_that_comes_with_a_loss_nobody_has_seen_yet_does_not_arm():
    floor = Floor()
    floor.inner.lose("base")
    floor.robot.submit(Command(STOP, 0.0))
    floor.inner.find()
    assert floor.robot.tick().reason is Reason.NEUTRAL_FIRST


def test_the_emergency_stop_holds_over_a_loss_and_the_loss_over_its_release():
    floor = Floor().driving()
    floor.robot.press_estop()
    floor.inner.lose("base")
    assert floor.stands(0.1, policy(STOP)) is Reason.ESTOP
    floor.robot.release_estop()
    assert floor.stands(0.1, policy(STOP)) is Reason.STALE
    floor.inner.find()
    assert floor.stands(0.1, policy(GO)) is Reason.NEUTRAL_FIRST


@pytest.mark.parametrize("idle", [bare_hand(STOP), hand(STOP, released=True)])
@pytest.mark.parametrize("first", [True, False])
def test_an_idle_hand_beside_a_policy_undoes_no_stop(idle, first):
    both = [idle, policy(GO)] if first else [policy(GO), idle]
    floor = Floor().driving()
    assert floor.stream(0.5, *both)[-1].twist == GO
    floor.robot.press_estop()
    floor.stands(0.3, *both)
    floor.robot.release_estop()
    assert floor.stands(1.0, *both) is Reason.NEUTRAL_FIRST
    floor.stream(0.1, idle, policy(STOP))
    assert floor.stream(0.5, *both)[-1].twist == GO
    floor.stream(0.6, idle)  # policy is silent: a stop, whatever the idle hand says
    assert floor.stands(1.0, *both) is Reason.NEUTRAL_FIRST


def test_a_hand_that_let_go_holds_it_for_a_moment_only():
    floor = Floor()
    floor.stream(0.1, hand(STOP))
    assert floor.stream(0.4, hand(GO))[-1].twist == GO
    assert floor.stands(0.1, hand(STOP, released=True)) is Reason.OK
    assert floor.stream(0.2, hand(STOP, released=True))[-1].reason is Reason.STALE
    assert floor.stands(0.3, hand(STOP, released=True), policy(GO)) is Reason.NEUTRAL_FIRST


def test_an_idle_policy_does_not_undo_the_stop_of_a_hand_that_still_pushes():
    floor = Floor()
    floor.stream(0.1, hand(STOP))
    assert floor.stream(0.4, hand(GO), policy(STOP))[-1].source is T
    floor.robot.press_estop()
    floor.stands(0.1, hand(GO), policy(STOP))
    floor.robot.release_estop()
    assert floor.stands(0.5, policy(STOP), hand(GO)) is Reason.NEUTRAL_FIRST
    floor.stream(0.5, policy(STOP))  # the hand's radio has a gap
    assert floor.stands(0.5, policy(STOP), hand(GO)) is Reason.NEUTRAL_FIRST
    floor.stream(0.1, policy(STOP), hand(STOP))
    assert floor.stream(0.4, policy(STOP), hand(GO))[-1].twist == GO


def test_a_person_arms_it_with_the_stick_at_rest_and_gives_the_wheel_to_policy():
    floor = Floor().driving()
    floor.stream(0.6)
    assert floor.stands(0.3, policy(GO)) is Reason.NEUTRAL_FIRST
    assert floor.stream(0.2, policy(GO), hand(STOP))[-1].reason is Reason.OK
    assert floor.stream(0.3, policy(GO), hand(STOP, released=True))[-1].twist == GO


def test_a_policys_farewell_arms_nothing_for_the_next():
    floor = Floor()
    floor.stream(0.1, hand(STOP))
    floor.say(STOP, T, epoch=2, released=True)
    floor.say(STOP, released=True)
    assert floor.stands(0.1, policy(GO, epoch=5)) is Reason.NEUTRAL_FIRST


class Bystander:
    """Follows from outside who has what it takes to move the robot; more lenient than the governor at no point but
    where two speak at once.

    A commander may move the robot if, since it stopped last, it has commanded zero; or if it is a hand that takes over
    from who has, and has not pushed since the stop; or policy, given control by such a hand.
    """

    def __init__(self):
        self.may, self.pushes, self.on = set(), set(), set()

    def stop(self):
        self.may.clear()

    def hears(self, who, twist, released):
        source = who[0]
        if is_neutral(twist) or released:
            self.pushes.discard(who)
            if source is T and released:
                if who in self.on and who in self.may:
                    self.may.add(P)
            elif not released:
                self.may.add(who)
        else:
            if source is T and who not in self.pushes and self.may:
                self.may.add(who)
            self.pushes.add(who)
        (self.on.discard if released else self.on.add)(who)

    def allows(self, applied: Applied):
        sessions = {(source, session_of(epoch)) for source, epoch in self.may - {P, T}}
        return (applied.source, applied.session) in sessions or applied.source in self.may


PEERS = {"policy": (P, 1), "other policy": (P, 7), "bare policy": (P, 0), "hand": (T, 2), "bare hand": (T, 3)}
SPEECH = st.tuples(
    st.sampled_from([*PEERS, "policy", "hand", "bare hand"]), st.sampled_from([STOP, GO, GO, Twist(-0.1, 0.5)])
)
CHANGES = st.sampled_from(
    ["pass", "pass", "gap", "lose", "find", "find", "blip", "press", "release", "release", "block", "clear", "let go"]
)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.one_of(CHANGES, SPEECH), st.booleans()), max_size=60))
def test_it_never_moves_unless_who_drives_has_been_at_zero_since_the_last_stop(script):
    floor, bystander, pushing = Floor(), Bystander(), None
    inner, robot = floor.inner, floor.robot

    def look(applied):
        if applied.reason not in DRIVING:
            bystander.stop()
        if not is_neutral(applied.twist):
            assert bystander.allows(applied), (applied, bystander.may)

    def say(name, twist, *, released=False):
        source, epoch = PEERS[name]
        released = released or (name == "bare hand" and is_neutral(twist))
        refused = sum(robot.refused.values())
        robot.submit(Command(twist, robot.now(), source, released=released, epoch=epoch))
        if sum(robot.refused.values()) == refused:
            bystander.hears((source, epoch), twist, released)
        look(robot.tick())

    for wish, repeat in script:
        if isinstance(wish, tuple):
            pushing = wish if repeat else pushing  # said again and again from now on, beside everything else
            say(*wish)
        elif wish == "let go":
            say("hand", STOP, released=True)
        elif wish == "press":
            robot.press_estop()
            bystander.stop()
        elif wish == "release":
            robot.release_estop()
            bystander.stop()
        elif wish in ("lose", "blip"):
            inner.lose("base")
            bystander.stop()
            inner.lost = inner.lost if wish == "lose" else ()
        elif wish == "find":
            inner.find()
        elif wish in ("block", "clear"):
            inner.blocked = wish == "block"
        for _ in range(15 if wish == "gap" else 3):
            robot.read()
            look(robot.tick())
            if pushing is not None and wish != "gap":
                say(*pushing)
            robot.wait(robot.now() + TICK_S)
