"""One contract, every robot."""

import math

import pytest
from robots import REAL_TIME, ROBOTS, STEPPED, STILL, Rig

from lira.hal.errors import LiraError
from lira.hal.messages import STOP, Applied, Command, Episode, Reason, Source, Twist, is_neutral
from lira.hal.port import Arena, Robot

pytestmark = pytest.mark.slow

STEPS = 60  # more than any robot needs to do as told, over any bus


@pytest.fixture(params=ROBOTS)
def rig(request):
    with ROBOTS[request.param]() as rig:
        yield rig


def step(rig: Rig, twist: Twist, hand: Twist | None = None, *, released: bool = False) -> Applied:
    """One period of policy's command, with a hand on the controls or not."""
    robot = rig.robot
    seq = robot.read().seq
    if hand is not None:
        robot.drive(Command(hand, robot.now(), Source.TELEOP, seq, released))
    applied = robot.drive(Command(twist, robot.now(), answers=seq))
    # A hand's command holds for a period at most; where time passes by itself the next has to come well before.
    hurried = rig.real_time and hand is not None
    robot.wait(robot.now() + (robot.profile.control.teleop_timeout_s / 2 if hurried else robot.profile.period_s))
    return applied


def steps_until(rig: Rig, twist: Twist, wanted, hand: Twist | None = None) -> Applied:
    """Repeat a step until `wanted(applied)`: over the bus in real time an answer is a step behind.

    Where a busy machine lets a robot in real time stop on the way, it is armed again.
    """
    for _ in range(STEPS):
        applied = step(rig, twist, hand)
        if wanted(applied):
            return applied
        if rig.real_time and twist != STOP and applied.reason is Reason.NEUTRAL_FIRST:
            armed(rig)
    raise AssertionError(f"never: {applied}")


def armed(rig: Rig) -> Rig:
    steps_until(rig, STOP, lambda applied: applied.reason is Reason.OK)
    return rig


def go(rig: Rig, share: float = 0.5) -> Twist:
    base = rig.robot.profile.base
    return Twist(share * base.max_linear_m_s, 0.25 * base.max_angular_rad_s)


def same(twist: Twist):
    return lambda applied: applied.twist == twist


def test_it_is_a_robot(rig):
    robot: Robot = rig.robot
    arena: Arena = rig.arena
    assert robot.profile.name == "thesis-sim"
    assert math.isfinite(robot.now())
    assert math.isfinite(arena.state().x_m)


def test_an_observation_has_every_sensor_with_its_capture_time(rig):
    armed(rig)
    for _ in range(STEPS):
        step(rig, STOP)
        observation = rig.robot.read()
        if None not in (observation.scan, observation.image, observation.odom):
            break
    assert observation.scan.ranges.shape == (rig.robot.profile.lidar.beams,)
    for sensor in (observation.scan, observation.image, observation.odom):
        assert -0.31 < sensor.stamp_s - rig.robot.now() <= 0.01
    assert observation.stamp_s <= rig.robot.now() + 1e-6


def test_observations_are_numbered_in_order_and_time_goes_on(rig):
    armed(rig)
    seen = []
    while len({seq for seq, _ in seen}) < 4:
        assert len(seen) < (STEPS if rig.real_time else 4)  # one that lags is read twice
        step(rig, STOP)
        seen.append((rig.robot.read().seq, rig.robot.now()))
    assert seen == sorted(set(seen))


def test_waiting_lets_time_pass_and_the_past_is_not_waited_for(rig):
    armed(rig)
    robot = rig.robot
    before_s = robot.now()
    robot.wait(before_s - 1.0)
    robot.drive(Command(STOP, robot.now(), answers=robot.read().seq))
    until_s = robot.now() + robot.profile.period_s
    robot.wait(until_s)
    assert robot.now() >= until_s - 1e-6
    if not rig.real_time:
        assert robot.now() == pytest.approx(before_s + robot.profile.period_s, abs=0.01)


def test_nothing_moves_before_a_neutral_command(rig):
    for _ in range(4):
        assert is_neutral(step(rig, go(rig)).twist)
    assert rig.arena.state().x_m == pytest.approx(0.0, abs=1e-6)
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))


@pytest.mark.parametrize("rig", sorted(set(ROBOTS) - STILL), indirect=True)  # a recording takes commands, and stays
def test_it_drives_as_told_and_says_so(rig):
    armed(rig)
    x_m = rig.arena.state().x_m
    applied = steps_until(rig, go(rig), same(go(rig)))
    assert (applied.source, applied.reason, applied.clamps) == (Source.POLICY, Reason.OK, ())
    for _ in range(15):
        step(rig, go(rig))
    assert rig.arena.state().x_m > x_m + 0.2
    assert rig.robot.read().odom.linear_m_s > 0.0


@pytest.mark.parametrize("rig", sorted(set(ROBOTS) - REAL_TIME), indirect=True)  # there the answer is a step behind
def test_in_its_own_time_a_command_is_applied_at_once(rig):
    armed(rig)
    seq = rig.robot.read().seq
    applied = step(rig, go(rig))
    assert applied.twist == go(rig)
    assert applied.answers == seq
    assert applied.command_age_s == pytest.approx(0.0, abs=1e-6)


def test_limits_hold_and_are_named(rig):
    armed(rig)
    base = rig.robot.profile.base
    applied = steps_until(rig, Twist(99.0, -99.0), lambda applied: bool(applied.clamps))
    assert applied.twist == Twist(base.max_linear_m_s, -base.max_angular_rad_s)
    assert set(applied.clamps) == {"linear", "angular"}


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_stops_it_until_neutral(rig, bad):
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))
    applied = steps_until(rig, Twist(bad, 0.0), lambda applied: applied.reason is Reason.REFUSED)
    assert applied.twist == STOP
    applied = steps_until(rig, go(rig), lambda applied: applied.reason is Reason.NEUTRAL_FIRST)
    assert applied.twist == STOP
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))


def test_a_person_takes_over_and_hands_back_without_a_stop(rig):
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))
    hand = Twist(0.0, 0.5)
    assert steps_until(rig, go(rig), same(hand), hand).source is Source.TELEOP
    assert step(rig, go(rig), hand).twist == hand
    step(rig, go(rig), STOP, released=True)
    for _ in range(STEPS):
        applied = step(rig, go(rig))
        assert applied.reason is Reason.OK
        if applied.source is Source.POLICY:
            break
    assert applied.twist == go(rig)


@pytest.mark.parametrize("rig", sorted(set(ROBOTS) - STEPPED), indirect=True)  # there silence stops time
def test_silence_stops_it_and_motion_does_not_start_it_again(rig):
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))
    rig.robot.wait(rig.robot.now() + 1.2)
    state = rig.arena.state()
    assert (state.linear_m_s, state.angular_rad_s) == (0.0, 0.0)
    applied = steps_until(rig, go(rig), lambda applied: applied.reason is Reason.NEUTRAL_FIRST)
    assert applied.twist == STOP
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))


def test_late_commands_are_not_obeyed(rig):
    armed(rig)
    robot = rig.robot
    for _ in range(4):
        seq = robot.read().seq
        robot.drive(Command(go(rig), robot.now() - 1.0, answers=seq))
        robot.wait(robot.now() + robot.profile.period_s)
    assert rig.arena.state().x_m == pytest.approx(0.0, abs=1e-6)


def test_a_reset_starts_a_new_episode_at_once(rig):
    armed(rig)
    for _ in range(3):
        step(rig, go(rig))
    before = rig.robot.read()
    rig.arena.reset(Episode(layout=1, start_m=2.0))
    after = rig.robot.read()
    assert after.seq > before.seq
    assert after.stamp_s >= before.stamp_s
    state = rig.arena.state()
    if not rig.real_time:  # there the last command may still be alive
        assert state.linear_m_s == 0.0
    assert (state.collided, state.lost, state.finished) == (False, False, False)
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))


def test_after_close_it_stands_and_may_be_closed_again(rig):
    armed(rig)
    steps_until(rig, go(rig), same(go(rig)))
    rig.robot.close()
    rig.robot.close()
    if rig.real_time or rig.stepped:
        with pytest.raises(LiraError):
            rig.robot.read()
