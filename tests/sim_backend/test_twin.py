import math
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from fresh import python

from lira.hal.errors import ConfigError, DeviceError
from lira.hal.messages import Command, CompressedImage, Episode, Image, Reason, Source, Twist
from lira.hal.profile import load_profile
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.scenes.silence import quiet
from lira.sim_backend.twin import Twin

SIM = load_profile("thesis-sim")
ROSBOT = load_profile("rosbot2")


@pytest.fixture
def twin():
    opened = []

    def make(world="line", profile=SIM, **options):
        opened.append(Twin(profile, world, **options))
        opened[-1].open()
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def steer(robot, linear, angular=0.0):
    return robot.drive(Command(Twist(linear, angular), robot.now()))


def drive_a_while(robot, seed, steps=12):
    """Everything that is seen and true along a drive with random steering."""
    rng = np.random.default_rng(seed)
    seen = []
    for _ in range(steps):
        observation = robot.read()
        steer(robot, 1.0, rng.uniform(-1, 1))
        robot.wait(robot.now() + 0.2)
        seen.append((observation.image.data.tobytes(), observation.scan.ranges.tobytes(), robot.state()))
    return seen


def test_in_lockstep_time_passes_only_in_wait(twin):
    robot = twin()
    steer(robot, 1.0)
    assert robot.now() == 0.0
    robot.read()
    robot.state()
    assert robot.now() == 0.0
    robot.wait(0.4)
    assert robot.now() == pytest.approx(0.4)
    assert robot.state().x_m == pytest.approx(0.4, abs=0.01)
    robot.wait(0.1)
    assert robot.now() == pytest.approx(0.4)


def test_time_does_not_run_back_over_a_reset(twin):
    robot = twin()
    steer(robot, 1.0)
    robot.wait(1.0)
    before = robot.read()
    robot.reset(Episode(start_m=5.0))
    assert robot.now() == pytest.approx(1.0)
    after = robot.read()
    assert after.seq > before.seq
    assert after.image.stamp_s == pytest.approx(1.0)
    assert robot.state().progress_m == pytest.approx(5.0, abs=0.01)
    assert robot.state().linear_m_s == 0.0


def test_a_reset_stops_the_robot(twin):
    robot = twin()
    steer(robot, 1.0)
    robot.reset(Episode())
    robot.wait(1.0)
    assert robot.state().x_m == pytest.approx(0.0, abs=1e-6)


def test_an_episode_may_start_off_the_line(twin):
    robot = twin()
    robot.reset(Episode(start_m=1.0, lateral_m=0.5, yaw_rad=-0.3))
    state = robot.state()
    assert (state.x_m, state.y_m, state.yaw_rad) == pytest.approx((1.0, 0.5, -0.3), abs=0.01)
    assert (state.progress_m, state.lateral_m) == pytest.approx((1.0, 0.5), abs=0.01)


def test_in_real_time_the_clock_runs_by_itself(twin):
    robot = twin(realtime_factor=4.0)
    steer(robot, 0.5)
    began, then = time.monotonic(), robot.now()
    robot.wait(then + 0.8)
    assert time.monotonic() - began >= 0.2
    assert robot.now() - then >= 0.8
    state = robot.state()
    # It moved for as long as its clock ran since the command, however late this thread came back.
    assert state.x_m == pytest.approx(0.5 * (state.stamp_s - then), abs=0.5 * 0.2)


def test_in_real_time_the_robot_moves_without_being_asked(twin):
    robot = twin(realtime_factor=5.0)
    applied = steer(robot, 0.2)
    time.sleep(0.1)
    state = robot.state()
    assert state.stamp_s - applied.stamp_s >= 0.5
    assert state.x_m == pytest.approx(0.2 * (state.stamp_s - applied.stamp_s), rel=1e-3)


def test_a_sensor_is_captured_anew_when_its_period_has_passed(twin):
    robot = twin()  # camera at 15 Hz, lidar at 10 Hz
    first = robot.read()
    robot.wait(0.05)
    second = robot.read()
    assert second.image is first.image
    assert second.scan is first.scan
    assert (second.seq, second.stamp_s) == (first.seq + 1, pytest.approx(0.05))
    robot.wait(0.07)
    third = robot.read()
    assert third.image.stamp_s == pytest.approx(0.07)
    assert third.scan is first.scan
    robot.wait(0.1)
    assert robot.read().scan.stamp_s == pytest.approx(0.1)


def test_reading_twice_at_one_moment_is_one_observation(twin):
    robot = twin()
    assert robot.read() is robot.read()


def test_every_step_is_a_new_observation(twin):
    robot = twin()
    numbers = []
    for tick in range(5):
        robot.wait(0.01 * tick)
        numbers.append(robot.read().seq)
    assert numbers == [1, 2, 3, 4, 5]


def test_what_is_read_fits_the_profile(twin):
    seen = twin().read()
    assert isinstance(seen.image, Image)
    assert seen.image.data.shape == (32, 32, 3)
    assert len(seen.scan.ranges) == 101
    seen = twin(profile=ROSBOT).read()
    assert isinstance(seen.image, CompressedImage)
    assert len(seen.scan.ranges) == 400


def test_commands_are_clamped_and_answered(twin):
    robot = twin()
    robot.wait(0.5)
    applied = robot.drive(Command(Twist(3.0, -0.4), 0.4, Source.TELEOP, answers=7))
    assert applied.twist == Twist(1.0, -0.4)
    assert applied.clamps == ("linear",)
    assert (applied.source, applied.reason, applied.answers) == (Source.TELEOP, Reason.OK, 7)
    assert applied.command_age_s == pytest.approx(0.1)
    assert steer(robot, 0.5, -9.0).twist == Twist(0.5, -1.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_and_stops(twin, bad):
    robot = twin()
    steer(robot, 1.0)
    robot.wait(0.2)
    applied = steer(robot, 0.5, bad)
    assert applied.reason == Reason.REFUSED
    assert applied.twist == Twist(0.0, 0.0)
    there = robot.state().x_m
    robot.wait(1.0)
    assert robot.state().x_m == there


def test_one_seed_gives_one_drive(twin):
    a, b, c = twin("race", layout=3), twin("race", layout=3), twin("race", layout=4)
    first = drive_a_while(a, 1)
    assert drive_a_while(b, 1) == first
    assert drive_a_while(c, 1) != first


def test_noise_comes_from_the_seed(twin):
    one, same, other = (twin("race", ROSBOT, seed=seed, renderer="tiny") for seed in (5, 5, 6))
    first = one.read()
    assert np.array_equal(first.scan.ranges, same.read().scan.ranges, equal_nan=True)
    assert not np.array_equal(first.scan.ranges, other.read().scan.ranges, equal_nan=True)


def test_twins_in_one_process_do_not_see_each_other(twin):
    alone = drive_a_while(twin("race", layout=1), 2)
    one, _ = twin("race", layout=1), twin("forest")
    busy = twin("race", layout=2)
    busy.reset(Episode(layout=5))
    assert drive_a_while(one, 2) == alone


def test_a_new_layout_moves_the_boxes(twin):
    robot, fresh = twin("race", layout=0), twin("race", layout=7)
    robot.read()
    robot.reset(Episode(layout=7))
    assert robot.layout.blocks == fresh.layout.blocks
    assert drive_a_while(robot, 3)[0][:2] == drive_a_while(fresh, 3)[0][:2]


def test_a_collision_is_reported_until_the_next_episode(twin):
    robot = twin("forest")
    steer(robot, 1.0)
    robot.wait(6.0)
    assert robot.state().collided
    robot.reset(Episode())
    assert not robot.state().collided


def test_odometry_is_the_truth_when_the_drive_is_ideal_and_drifts_when_it_skids(twin):
    ideal, real = twin(), twin(profile=ROSBOT)
    start = real.state().yaw_rad
    for robot in (ideal, real):
        steer(robot, 0.1, 0.5)
        robot.wait(1.0)
        steer(robot, 0.1, 0.5)
        robot.wait(2.0)
    seen, truth = ideal.read().odom, ideal.state()
    assert (seen.x_m, seen.y_m) == pytest.approx((truth.x_m, truth.y_m), abs=0.01)
    assert real.read().odom.yaw_rad == pytest.approx(0.26 / 0.2378 * (real.state().yaw_rad - start), abs=1e-3)


def test_driving_never_waits_for_a_picture(twin, monkeypatch):
    robot = twin()
    drawing, finish = threading.Event(), threading.Event()

    def slow(*_):
        drawing.set()
        assert finish.wait(10.0)
        return np.zeros((32, 32), np.uint8)

    monkeypatch.setattr(robot._sensors._camera, "render", slow)
    reader = threading.Thread(target=robot.read)
    reader.start()
    assert drawing.wait(10.0)
    steer(robot, 0.0)  # would hang here
    robot.state()
    finish.set()
    reader.join(10.0)
    assert not reader.is_alive()


def test_reading_before_open_or_after_close_is_refused():
    robot = Twin(SIM, "line")
    with pytest.raises(DeviceError, match="not open"):
        robot.read()
    robot.open()
    robot.open()
    robot.read()
    robot.close()
    robot.close()
    with pytest.raises(DeviceError, match="not open"):
        robot.read()


def test_closing_stops(twin):
    robot = twin()
    steer(robot, 1.0)
    robot.close()
    robot.wait(1.0)
    assert robot.state().x_m == 0.0


def test_bad_options_are_refused():
    with pytest.raises(ConfigError, match="unknown world"):
        Twin(SIM, "nosuch")
    with pytest.raises(ConfigError, match="not positive"):
        Twin(SIM, "line", realtime_factor=0.0)


def test_without_pybullet_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(ConfigError, match="pybullet is not installed"):
        Twin(SIM, "line", renderer="tiny")


def test_without_pybullet_the_twin_is_a_sketch(monkeypatch, twin):
    assert twin().renderer == "tiny"
    monkeypatch.setitem(sys.modules, "pybullet", None)
    robot = twin()
    assert robot.renderer == "sketch"
    assert robot.read().image is not None


def test_nothing_but_reports_reaches_the_standard_output():
    code = (
        "from lira.hal.profile import load_profile; from lira.sim_backend.twin import Twin\n"
        "t = Twin(load_profile('rosbot2'), 'line'); t.open(); t.read(); t.close(); print('report')"
    )
    done = python(code)
    assert (done.returncode, done.stdout, done.stderr) == (0, "report\n", "")


def test_quiet_gives_the_streams_back_after_an_error(capfd):
    with pytest.raises(ZeroDivisionError), quiet():
        1 / 0  # noqa: B018
    print("here")
    assert capfd.readouterr().out == "here\n"


def test_with_egl_any_thread_may_look_and_two_twins_do_not_mix():
    try:
        pair = [Twin(SIM, "race", layout=seed, renderer="egl") for seed in (1, 2)]
        for robot in pair:
            robot.open()
    except ConfigError as error:
        pytest.skip(str(error))
    plain = [Twin(SIM, "race", layout=seed, renderer="tiny") for seed in (1, 2)]
    for robot in plain:
        robot.open()
    for _ in range(3):
        seen = []
        for robot in pair + plain:
            with ThreadPoolExecutor(1) as another_thread:
                seen.append(another_thread.submit(robot.read).result().image.data.astype(int))
            steer(robot, 1.0)
            robot.wait(robot.now() + 4.0)
        assert [np.abs(seen[n] - seen[n + 2]).mean() < 0.5 for n in (0, 1)] == [True, True]
    for robot in pair + plain:
        robot.close()


# Foresight


@pytest.fixture(params=[SIM, ROSBOT], ids=lambda profile: profile.name)
def ahead(request):
    foresight = Foresight(request.param, "race", layout=2, renderer="tiny")
    yield foresight, request.param
    foresight.close()


def moving(twin, profile):
    robot = twin("race", profile, layout=2, renderer="tiny")
    steer(robot, 0.2, 0.3)
    robot.wait(0.8)
    return robot


def test_a_rollout_is_what_then_happens(twin, ahead):
    foresight, profile = ahead
    robot = moving(twin, profile)
    base = profile.base
    dreamt = foresight.rollout(robot.state(), lambda _: (1.0, -0.1), 5, 0.2)
    for each in dreamt:
        steer(robot, base.max_linear_m_s, -0.1 * base.max_angular_rad_s)
        robot.wait(robot.now() + 0.2)
        real = robot.state()
        assert (each.x_m, each.y_m, each.yaw_rad) == pytest.approx((real.x_m, real.y_m, real.yaw_rad), abs=1e-9)
        assert (each.progress_m, each.lateral_m) == pytest.approx((real.progress_m, real.lateral_m), abs=1e-9)
        assert each.clearance_m == pytest.approx(real.clearance_m)


def test_imagining_agrees_with_the_rollout(twin, ahead):
    foresight, profile = ahead
    state = moving(twin, profile).state()
    dreamt = foresight.rollout(state, lambda _: (0.8, 0.2), 6, 0.2)
    actions = np.zeros((3, 6, 2))
    actions[1] = (0.8, 0.2)
    imagined = foresight.imagine(state, actions, 0.2)
    assert imagined.x_m.shape == (3, 6)
    for t, each in enumerate(dreamt):
        assert imagined.x_m[1, t] == pytest.approx(each.x_m)
        assert imagined.y_m[1, t] == pytest.approx(each.y_m)
        assert imagined.progress_m[1, t] == pytest.approx(each.progress_m)
        assert imagined.lateral_m[1, t] == pytest.approx(each.lateral_m)
    assert imagined.x_m[0, -1] < imagined.x_m[1, -1]


def test_the_policy_sees_what_it_would_see_there(twin):
    foresight = Foresight(SIM, "race", layout=2)
    robot = moving(twin, SIM)
    seen = []
    foresight.rollout(robot.state(), lambda look: seen.extend(map(look, ("image", "scan"))) or (0.0, 0.0), 1, 0.2)
    foresight.close()
    image, scan = seen
    real = robot.read()
    assert np.array_equal(image.data, real.image.data)
    assert np.array_equal(scan.ranges, real.scan.ranges)


def test_a_rollout_ends_with_a_collision():
    foresight = Foresight(SIM, "forest")
    robot = Twin(SIM, "forest")
    states = foresight.rollout(robot.state(), lambda _: (1.0, 0.0), 50, 0.2)
    foresight.close()
    assert states[-1].collided
    assert not any(each.collided for each in states[:-1])
    assert len(states) == 19  # 3.62 m at 0.2 m a step


def test_imagining_sees_the_collision_coming():
    foresight, robot = Foresight(SIM, "forest"), Twin(SIM, "forest")
    actions = np.zeros((2, 20, 2))
    actions[0, :, 0] = 1.0
    imagined = foresight.imagine(robot.state(), actions, 0.2)
    assert imagined.clearance_m[0].min() < 0.0
    assert imagined.clearance_m[0, 5] == pytest.approx(4.0 - 0.225 - 1.2 - 0.1543, abs=1e-3)
    assert imagined.clearance_m[1].min() > 3.0
    assert np.isnan(imagined.lateral_m).all()


def test_foresight_follows_to_another_layout():
    foresight = Foresight(SIM, "race", layout=0)
    foresight.set_layout(4)
    robot = Twin(SIM, "race", layout=4)
    foresight.rollout(robot.state(), lambda _: (1.0, 0.0), 1, 0.2)
    assert foresight.course.layout.blocks == robot.layout.blocks
    assert foresight._twin.layout.blocks == robot.layout.blocks
    foresight.close()
