"""Sessions on a straight track that only exists here: walls that can be hit once, and a finish."""

import math
from dataclasses import replace

import pytest

from lira.fusion.control import ControlLoop
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord
from lira.fusion.methods.base import Alone, Choice, Lesson, Proposal
from lira.fusion.teaching.ride import LOST_OBSERVATIONS, PUT_BACK_M, PUT_ON_M, Drive, Place, Ride, Tally, abreast
from lira.fusion.teaching.session import Same, Session
from lira.hal.errors import DeviceError
from lira.hal.messages import Call, Episode, Phase
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.testing import NullRobot

PROFILE = load_profile("thesis-sim")
STEP_M = PROFILE.period_s * PROFILE.base.max_linear_m_s
NEVER_S = 60.0


class Track(NullRobot):
    """A straight line with walls across it; each falls when it is hit, so that whoever comes again gets past."""

    def __init__(self, *, walls=(), finish_m=4.0, line=True):
        super().__init__(PROFILE)
        self.walls, self.finish_m, self.line = list(walls), finish_m, line
        self.collided, self.episodes, self.blind = False, [], False

    def reset(self, episode):
        super().reset(episode)
        self.collided = False
        self.episodes.append(episode)

    def read(self):
        return replace(super().read(), scan=None) if self.blind else super().read()

    def state(self):
        state = super().state()
        if not self.collided and self.walls and state.x_m >= self.walls[0]:
            self.walls.pop(0)
            self.collided = True
        lost, finished = abs(state.y_m) > 1.5, state.x_m >= self.finish_m
        place = {} if self.line else {"progress_m": math.nan, "lateral_m": math.nan}
        return replace(state, collided=self.collided, lost=lost, finished=finished, **place)


class Mind:
    """A novice that is trained from its `after`-th lesson on."""

    def __init__(self, action, after):
        self.action, self.after, self.lessons = action, after, 0

    @property
    def training_steps(self):
        return self.lessons // self.after

    @property
    def trained(self):
        return self.training_steps > 0

    def act(self, features):
        return self.action

    alone = act

    def set_aside(self):
        return []


class Pupil:
    """A method whose novice drives, and counts what the human does."""

    def __init__(self, action=(1.0, 0.0), after=1):
        self.novice = Mind(action, after)
        self.resets = 0

    def reset(self):
        self.resets += 1

    def update(self, now_s):
        pass

    def propose(self, features):
        return Proposal(features, Choice("novice", self.novice.action), self.novice.action)

    def learn(self, proposal, human):
        if human is None:
            return Lesson(proposal.choice)
        self.novice.lessons += 1
        return Lesson(Choice("human", human, label=human), stored=True)

    def policy(self, driver):
        return self.novice.act


class Hand:
    """Holds control for the first steps of every episode."""

    def __init__(self, steps=1):
        self.steps, self.left, self.layouts = steps, steps, []

    def reset(self, layout):
        self.left = self.steps
        self.layouts.append(layout)

    def act(self, state, proposal, policy, offers):
        self.left -= 1
        return (1.0, 0.0) if self.left >= 0 else None


def school(track, pupil=None):
    """A session on a track, and where its lap records go."""
    records = []
    pupil = pupil or Pupil()
    robot = GovernedRobot(track)
    session = Session(robot, track, Journal(write=records.append), pupil)
    return session, lambda: [record for record in records if isinstance(record, LapRecord)]


class Fresh:
    """A layout for each training lap, and `proofs` others to prove it, of which `spare` may fail."""

    def __init__(self, proofs, spare=0):
        self.proofs, self.spare = proofs, spare

    def taught(self, number):
        return [Drive(Episode(10 * number), NEVER_S)]

    def proven(self, number):
        return [[Drive(Episode(10 * number + 1 + k), NEVER_S)] for k in range(self.proofs)]


@pytest.fixture
def walled():
    """A track with a wall on these layouts."""

    def make(*layouts):
        track = Track()
        reset = track.reset

        def put_down(episode):
            reset(episode)
            track.walls = [2.0] if episode.layout in layouts else []

        track.reset = put_down
        return track

    return make


def test_several_proving_runs_have_to_be_passed_in_a_row_and_the_first_failure_ends_them(walled):
    session, laps = school(walled(11, 22))
    assert session.teach(Fresh(3), Hand(), 5)
    assert [(lap.phase, lap.lap, lap.layout, lap.passed) for lap in laps()] == [
        ("train", 1, 10, True),
        ("prove", 1, 11, False),
        ("train", 2, 20, True),
        ("prove", 2, 21, True),
        ("prove", 2, 22, False),
        ("train", 3, 30, True),
        *[("prove", 3, layout, True) for layout in (31, 32, 33)],
    ]


def test_so_many_proving_runs_may_fail(walled):
    session, laps = school(walled(11, 12, 22))
    assert session.teach(Fresh(3, spare=1), Hand(), 5)
    proofs = [(lap.layout, lap.passed) for lap in laps() if lap.phase == "prove"]
    assert proofs == [(11, False), (12, False), (21, True), (22, False), (23, True)]


def test_a_lap_and_a_proving_run_on_the_same_drive_end_the_teaching():
    track, hand = Track(), Hand()
    session, laps = school(track)
    assert session.teach(Same([Drive(Episode(3), NEVER_S)]), hand, 5)
    assert [(lap.phase, lap.lap, lap.layout, lap.passed, lap.unassisted) for lap in laps()] == [
        ("train", 1, 3, True, False),
        ("prove", 1, 3, True, True),
    ]
    assert track.episodes == [Episode(3)] * 2
    assert hand.layouts == [3]  # nobody holds the novice's hand while it proves itself


def test_a_novice_without_a_training_step_proves_nothing():
    session, laps = school(Track(), Pupil(after=3))
    assert session.teach(Same([Drive(Episode(), NEVER_S)]), Hand(), 5)
    assert [lap.phase for lap in laps()] == ["train", "train", "train", "prove"]


def test_after_a_crash_in_training_it_starts_again_before_it():
    track, hand = Track(walls=[3.0]), Hand(steps=0)
    session, laps = school(track, pupil := Pupil())
    session.teach(Same([Drive(Episode(), NEVER_S)]), hand, 1)
    first, again = track.episodes
    assert first == Episode()
    assert again.start_m == pytest.approx(3.0 - PUT_BACK_M, abs=1.5 * STEP_M)
    assert again.began_m == 0.0
    assert hand.layouts == [0, 0]
    assert pupil.resets == 3  # before each drive, and when the lap is over
    (lap,) = laps()
    assert (lap.collisions, lap.passed) == (1, False)
    assert lap.duration_s == pytest.approx((4.0 + PUT_BACK_M) / PROFILE.base.max_linear_m_s, abs=0.5)


def test_a_crash_near_the_start_starts_at_the_start():
    track = Track(walls=[0.5])
    session, _ = school(track)
    session.teach(Same([Drive(Episode(), NEVER_S)]), Hand(), 1)
    assert track.episodes[1] == Episode(start_m=0.0, began_m=0.0)


def test_a_world_without_a_line_is_started_all_over():
    track = Track(walls=[3.0], line=False)
    session, laps = school(track)
    drive = Drive(Episode(2, lateral_m=0.1), NEVER_S)
    session.teach(Same([drive]), Hand(), 1)
    assert track.episodes[:2] == [drive.episode] * 2
    assert laps()[0].lateral_rms_m is None


def test_a_proving_run_ends_at_the_first_harm():
    track = Track(walls=[1.0] * 50)
    session, laps = school(track)
    assert not session.teach(Same([Drive(Episode(layout), 3.0) for layout in (0, 1)]), Hand(), 1)
    train, prove = laps()
    assert train.collisions > 2
    assert (prove.collisions, prove.passed) == (1, False)
    assert prove.duration_s == pytest.approx(1.0, abs=0.3)
    assert track.episodes[-1] == Episode(0)  # neither put back nor on to the next drive


def test_a_run_that_meets_its_cap_is_reported_as_such():
    session, laps = school(Track(), Pupil(action=(0.1, 0.0)))
    assert not session.teach(Same([Drive(Episode(), 2.0)]), Hand(), 3)
    assert [lap.phase for lap in laps()] == ["train", "prove"] * 3
    assert not any(lap.passed for lap in laps())
    result = session.result(converged=False)
    assert (result.converged, result.laps) == (False, 3)
    assert result.human_labels + result.demonstration == 3
    assert result.simulated_s == pytest.approx(12.0, abs=1.5)


def test_on_unseen_layouts_it_goes_on_behind_a_crash():
    track = Track(walls=[2.0])
    session, laps = school(track)
    shown = session.show([Drive(Episode(layout), NEVER_S) for layout in (7, 8)])
    assert shown == laps()
    assert [(lap.phase, lap.lap, lap.layout, lap.collisions) for lap in shown] == [
        ("unseen", 1, 7, 1),
        ("unseen", 2, 8, 0),
    ]
    assert track.episodes[1].start_m == pytest.approx(2.0 + PUT_ON_M, abs=1.5 * STEP_M)
    assert track.episodes[1].layout == 7


@pytest.mark.parametrize(
    ("goal", "turn", "passed"),
    [("finish", 0.0, True), ("finish", 0.9, False), ("leave", 0.9, True), ("stay", 0.9, True), ("stay", 0.0, True)],
)
def test_what_counts_as_passed_depends_on_the_goal(goal, turn, passed):
    session, _ = school(Track(), Pupil(action=(1.0, turn)))
    (lap,) = session.show([Drive(Episode(yaw_rad=turn), 3.0 if turn else NEVER_S, goal)])
    assert lap.passed is passed


def test_a_drive_may_have_to_end_near_the_line():
    session, _ = school(Track())
    near, far = (Drive(Episode(lateral_m=lateral), 1.0, "stay", final_lateral_m=0.35) for lateral in (0.3, -0.5))
    assert [lap.passed for lap in session.show([near, far])] == [True, False]


def test_out_of_time_is_not_passed():
    session, _ = school(Track(), Pupil(action=(0.1, 0.0)))
    (lap,) = session.show([Drive(Episode(), 2.0)])
    assert (lap.passed, lap.collisions, lap.lost) == (False, 0, 0)
    assert lap.duration_s == pytest.approx(2.0, abs=0.3)


def test_a_sensor_that_stays_silent_ends_the_session_and_is_named():
    track = Track()
    track.blind = True
    session, _ = school(track)
    with pytest.raises(DeviceError, match=f"{LOST_OBSERVATIONS} observations in a row.*nothing new from the lidar"):
        session.show([Drive(Episode(), NEVER_S)])


class Stalling(Track):
    """A busy machine: nothing happens for a second, once, and the robot stops by itself."""

    def __init__(self):
        super().__init__(finish_m=6.0)
        self.reads = 0

    def read(self):
        self.reads += 1
        if self.reads == 8:
            self.wait(self.now() + 1.0)
        return super().read()


def test_a_robot_that_stopped_by_itself_is_armed_and_driven_on():
    track = Stalling()
    session, _ = school(track)
    (lap,) = session.show([Drive(Episode(), NEVER_S)])
    assert lap.passed
    # The second that nothing happened, one step to hear of it and one to arm it.
    assert lap.duration_s < 6.0 / PROFILE.base.max_linear_m_s + 2.0


class Wall(Track):
    """In front of a black box the camera sees nothing; put back it sees again."""

    def __init__(self):
        super().__init__(finish_m=3.0)
        self.blind = True

    def reset(self, episode):
        super().reset(episode)
        self.blind = len(self.episodes) == 1

    def state(self):
        return replace(super().state(), clearance_m=0.1 if self.blind else 2.0)


def test_who_sees_nothing_before_a_box_has_crashed_into_it():
    track = Wall()
    session, laps = school(track)
    session.show([Drive(Episode(), NEVER_S)])
    (lap,) = laps()
    assert (lap.collisions, lap.passed, len(track.episodes)) == (1, False, 2)


class Doubting:
    """Drives straight on, but from `x_m` on stands and asks until a human has driven once."""

    def __init__(self, track, x_m):
        self.track, self.x_m, self.asks = track, x_m, True

    def reset(self):
        self.asks = True

    def update(self, now_s):
        pass

    def propose(self, features):
        doubts = self.asks and self.track.state().x_m > self.x_m
        choice = Choice("novice", (0.0, 0.0), call=Call.FEEDBACK) if doubts else Choice("novice", (1.0, 0.0))
        return Proposal(features, choice)

    def learn(self, proposal, human):
        self.asks = self.asks and human is None
        return Lesson(proposal.choice if human is None else Choice("human", human))

    def policy(self, driver):
        return {"novice": lambda features: self.propose(features).choice.action}[driver]


class Answering(Hand):
    """Drives for a step whenever it is called."""

    def act(self, state, proposal, policy, offers):
        return (1.0, 0.0) if proposal.choice.call is Call.FEEDBACK else None


def in_doubt(track):
    records = []
    robot = GovernedRobot(track)
    robot.open()
    return Session(robot, track, Journal(write=records.append), None, lambda _: Doubting(track, 1.0)), records


def test_a_stop_in_doubt_ends_a_proving_run_for_nobody_is_there_to_answer():
    session, records = in_doubt(track := Track())
    assert session.prove(Same([Drive(Episode(), NEVER_S)])) is False
    lap = records[-1]
    assert (lap.stops, lap.collisions, lap.passed, lap.training_steps) == (1, 0, False, 0)
    assert 1.0 < track.state().x_m < 2.0


def test_on_an_unseen_layout_the_teacher_answers_and_the_stop_is_counted():
    session, _ = in_doubt(Track())
    (lap,) = session.show([Drive(Episode(), NEVER_S)], Answering(steps=0))
    assert (lap.stops, lap.passed, lap.unassisted) == (1, True, False)
    (lap,) = session.show([Drive(Episode(), 8.0)])
    assert (lap.stops, lap.passed) == (1, False)  # it still stands there


def test_without_an_apprentice_nobody_can_be_taught():
    session, _ = in_doubt(Track())
    with pytest.raises(ValueError, match="nobody to teach"):
        session.teach(Same([Drive(Episode(), NEVER_S)]), Hand(steps=0), 1)


class TestAbreast:
    """Several robots that one policy drives, step by step."""

    FINISHES_M = (1.0, 3.0, 2.0)

    def rides(self, phase=Phase.UNSEEN, **track):
        """Rides to different finishes, with their records."""
        made = []
        for finish_m in self.FINISHES_M:
            robot = Track(finish_m=finish_m, **track)
            governed, records = GovernedRobot(robot), []
            loop = ControlLoop(governed, truth=robot.state)
            loop.arm()
            place = Place(governed, robot, loop, Journal(write=records.append))
            made.append((Ride(place, self.driver, Drive(Episode(), NEVER_S), phase, 1, Tally()), records))
        return made

    @property
    def driver(self):
        return Alone("novice", self.act, lambda seen: [self.act(each) for each in seen])

    def act(self, features):
        return 1.0, 0.0

    def test_each_drives_until_its_own_end_and_only_who_drives_is_asked(self):
        asked = []

        def together(seen):
            asked.append(len(seen))
            return [(1.0, 0.0)] * len(seen)

        rides = self.rides()
        abreast([ride for ride, _ in rides], Alone("novice", self.act, together))
        assert [ride.record().duration_s for ride, _ in rides] == pytest.approx([1.0, 3.0, 2.0], abs=0.21)
        assert asked == sorted(asked, reverse=True)
        assert (asked[0], asked[-1]) == (3, 1)

    @pytest.mark.parametrize("phase", [Phase.UNSEEN, Phase.PROVE])
    def test_what_comes_of_it_is_what_comes_of_one_after_the_other(self, phase):
        together, alone = self.rides(phase, walls=(0.5,)), self.rides(phase, walls=(0.5,))
        abreast([ride for ride, _ in together], self.driver)
        for ride, _ in alone:
            while ride.goes_on:
                ride.step()
            ride.end()
        for (one, _), (other, _) in zip(together, alone, strict=True):
            assert one.tally == other.tally
            assert one.tally.collisions == 1
        assert [len(records) for _, records in together] == [len(records) for _, records in alone]

    def test_one_that_sees_nothing_waits_while_the_others_drive(self):
        rides = self.rides()
        blind = rides[1][0]._place.arena
        blind.blind = True
        with pytest.raises(DeviceError, match="could not be used"):
            abreast([ride for ride, _ in rides], self.driver)
        assert not rides[0][0].goes_on
        assert not rides[2][0].goes_on
