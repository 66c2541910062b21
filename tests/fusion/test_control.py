from dataclasses import replace

import numpy as np
import pytest

from lira.fusion.control import ControlLoop, to_action, to_twist
from lira.fusion.methods.base import Choice, Lesson, Proposal
from lira.hal.messages import Reason, Source, Twist
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.testing import NullRobot

PROFILE = load_profile("thesis-sim")
BASE = PROFILE.base


class Driver:
    """A method that always wants the same and remembers what it was taught."""

    def __init__(self, action=(0.5, 0.0), driver="novice", speed=1.0):
        self.choice, self.speed = Choice(driver, action), speed
        self.updates, self.lessons = [], []

    def reset(self):
        pass

    def update(self, now_s):
        self.updates.append(now_s)

    def propose(self, features):
        return Proposal(features, self.choice, novice=self.choice.action, speed=self.speed)

    def learn(self, proposal, human):
        self.lessons.append(human)
        return Lesson(proposal.choice if human is None else Choice("human", human, label=human))

    def policy(self, driver):
        return {"novice": self.act, "camera": self.act}[driver]

    def act(self, features):
        return self.choice.action


class Hand:
    """A teacher who does what the script says, one action a step, and remembers the policies it was shown."""

    def __init__(self, *script):
        self.script, self.policies = list(script), []

    def act(self, state, proposal, policy, offers):
        self.policies.append(policy)
        return self.script.pop(0)

    def reset(self, layout):
        pass


@pytest.fixture
def null():
    return NullRobot(PROFILE)


@pytest.fixture
def loop(null):
    """An armed loop on a governed robot."""
    loop = ControlLoop(GovernedRobot(null), truth=null.state)
    loop.arm()
    return loop


@pytest.mark.parametrize("action", [(1.0, -1.0), (0.3, 0.7), (0.0, 0.0)])
def test_an_action_is_a_fraction_of_the_limits(action):
    assert to_action(to_twist(action, BASE), BASE) == pytest.approx(action)


def test_an_action_out_of_range_is_clamped():
    assert to_twist((1.5, -9.0), BASE) == Twist(BASE.max_linear_m_s, -BASE.max_angular_rad_s)


def test_a_step_drives_learns_and_takes_one_period(null, loop):
    method = Driver()
    began_s = null.now()
    steps = [loop.step(method) for _ in range(3)]
    assert null.now() == pytest.approx(began_s + 3 * PROFILE.period_s)
    assert null.state().x_m == pytest.approx(3 * PROFILE.period_s * 0.5 * BASE.max_linear_m_s)
    assert method.updates == pytest.approx([began_s + k * PROFILE.period_s for k in range(3)])
    assert method.lessons == [None] * 3
    assert all(step.applied.answers == step.observation.seq for step in steps)


def test_after_a_stall_it_starts_afresh_instead_of_catching_up(null, loop):
    loop.step(Driver())
    null.wait(null.now() + 10.0)
    late_s = null.now()
    for _ in range(2):
        loop.step(Driver())
    assert null.now() == pytest.approx(late_s + PROFILE.period_s)  # the first is late already, the second on time


def test_a_robot_that_is_not_armed_teaches_nothing():
    method = Driver()
    step = ControlLoop(GovernedRobot(NullRobot(PROFILE))).step(method)
    assert step.applied.reason is Reason.NEUTRAL_FIRST
    assert step.lesson.choice.driver == "none"
    assert method.lessons == []


def test_a_slowed_command_keeps_its_curvature_and_the_lesson_its_size(null, loop):
    step = loop.step(Driver(action=(1.0, 0.5), speed=0.3))
    assert step.applied.twist == Twist(0.3 * BASE.max_linear_m_s, 0.15 * BASE.max_angular_rad_s)
    assert step.lesson.choice.action == (1.0, 0.5)


def test_the_hand_drives_at_once_is_learned_from_and_gives_the_wheel_back(loop):
    method, hand = Driver(), Hand((0.2, 1.0), (0.2, -1.0), None, None)
    steps = [loop.step(method, hand) for _ in range(4)]
    assert [step.applied.source for step in steps] == [Source.TELEOP, Source.TELEOP, Source.POLICY, Source.POLICY]
    assert [step.lesson.choice.driver for step in steps] == ["human", "human", "novice", "novice"]
    assert method.lessons == [pytest.approx((0.2, 1.0)), pytest.approx((0.2, -1.0)), None, None]
    assert {step.applied.reason for step in steps} == {Reason.OK}


def test_what_was_applied_is_learned_not_what_was_wished_for(loop):
    method = Driver()
    loop.step(method, Hand((7.0, -7.0)))
    assert method.lessons == [(1.0, -1.0)]


class Walled(NullRobot):
    """It stands before a wall, as near as its protective field lets it come."""

    def read(self):
        seen = super().read()
        return replace(seen, scan=replace(seen.scan, ranges=np.full_like(seen.scan.ranges, 0.15)))


@pytest.mark.parametrize(("hand", "learned"), [((1.0, -0.5), [(1.0, -0.5)]), (None, [])])
def test_what_the_field_took_from_a_hand_is_learned_and_nothing_of_a_policy_that_it_holds(hand, learned):
    robot = GovernedRobot(null := Walled(load_profile("rosbot2")))
    loop = ControlLoop(robot, truth=null.state)
    loop.arm()
    method = Driver()
    step = loop.step(method, Hand(hand))
    assert (step.applied.twist.linear_m_s, step.applied.reason) == (0.0, Reason.OBSTACLE)
    assert method.lessons == [pytest.approx(action) for action in learned]


@pytest.mark.parametrize(("driver", "shown"), [("novice", True), ("camera", True), ("none", False)])
def test_the_teacher_looks_ahead_with_whoever_drives(loop, driver, shown):
    method, hand = Driver(driver=driver), Hand(None)
    loop.step(method, hand)
    assert hand.policies == [method.act if shown else None]


def test_without_ground_truth_there_is_no_scripted_teacher():
    robot = GovernedRobot(NullRobot(PROFILE))
    loop = ControlLoop(robot)
    loop.arm()
    hand = Hand((1.0, 0.0))
    step = loop.step(Driver(), hand)
    assert step.state is None
    assert hand.policies == []


@pytest.mark.parametrize(
    ("missing", "trouble"),
    [
        ({"scan": None}, "nothing new from the lidar"),
        ({"image": None}, "nothing new from the camera"),
        ({"scan": None, "image": None}, "nothing new from the camera and the lidar"),
    ],
)
def test_without_a_sensor_it_stands_and_decides_nothing(missing, trouble):
    class Blind(NullRobot):
        blind = False

        def read(self):
            return replace(super().read(), **missing) if self.blind else super().read()

    null, method = Blind(PROFILE), Driver()
    loop = ControlLoop(null)
    loop.step(method)
    assert null.state().linear_m_s > 0.0
    null.blind = True
    began_s = null.now()
    assert loop.step(method) is None
    assert null.state().linear_m_s == 0.0
    assert null.now() == pytest.approx(began_s + PROFILE.period_s)
    assert loop.trouble == trouble
    assert loop.refused == 0
    assert method.lessons == [None]
    null.blind = False
    assert loop.step(method) is not None
    assert loop.trouble == ""


def test_a_reading_that_cannot_be_used_is_counted_and_stops_the_robot(null):
    class Short(NullRobot):
        def read(self):
            seen = super().read()
            return replace(seen, scan=replace(seen.scan, ranges=seen.scan.ranges[:50]))

    robot = Short(PROFILE)
    loop = ControlLoop(robot)
    assert loop.step(Driver()) is None
    assert loop.refused == 1
    assert "wrong length" in loop.trouble
    assert robot.state().linear_m_s == 0.0


def test_a_stale_sensor_does_not_arm_a_robot_that_stopped_by_itself(null):
    robot = GovernedRobot(null)
    robot.open()
    loop, driver = ControlLoop(robot), Driver()
    loop.arm()
    assert loop.step(driver).applied.reason is Reason.OK
    null.wait(robot.now() + 1.0)  # nobody commands for so long that the watchdog strikes
    assert loop.step(driver).applied.reason in (Reason.STALE, Reason.NEUTRAL_FIRST)

    whole, null.read = null.read, lambda: replace(whole(), scan=None)
    for _ in range(3):
        assert loop.step(driver) is None
    null.read = whole
    held = loop.step(driver).applied
    assert (held.twist, held.source) == (Twist(0.0, 0.0), Source.NONE)
    robot.close()


class StartedAnew(NullRobot):
    """Its clock can be set back under the loop; it remembers how long it was told to wait."""

    def __init__(self):
        self.clock_s, self.waits_s, self.anew = 5000.0, [], False
        super().__init__(PROFILE, lambda: self.clock_s, lambda _: None)

    def wait(self, until_s):
        self.waits_s.append(until_s - self.clock_s)
        self.clock_s = max(self.clock_s, until_s)

    def started_anew(self):
        anew, self.anew = self.anew, False
        return anew


def test_a_deadline_on_the_clock_of_an_earlier_start_is_not_waited_for():
    robot = StartedAnew()
    robot.open()
    loop = ControlLoop(robot)
    for _ in range(3):
        loop.stand()
    assert not loop.restarted()
    robot.clock_s, robot.anew = 0.5, True
    assert loop.restarted()
    assert not loop.restarted()
    for _ in range(3):
        loop.stand()
    assert max(robot.waits_s) <= PROFILE.period_s + 1e-9
    assert robot.clock_s == pytest.approx(0.5 + 2 * PROFILE.period_s)


def test_a_robot_that_knows_no_restart_is_never_started_anew():
    assert not ControlLoop(NullRobot(PROFILE)).restarted()
