"""The control loop: read, decide, drive, learn, report, keep time. The same page drives every robot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from lira.fusion.methods.base import STAND, Choice, Chooser, Lesson, Method, Policy, Proposal
from lira.fusion.preprocess import Features, Preprocessor
from lira.hal.errors import PluginError, SensorError
from lira.hal.messages import HELD as HELD
from lira.hal.messages import STOP, Action, Applied, Command, CourseState, Driver, Observation, Reason, Source, Twist
from lira.hal.port import Restartable, Robot
from lira.hal.profile import Base


class Teacher(Protocol):
    """Whoever can take control: a script here; a person does the same with a gamepad, from outside."""

    def act(
        self, state: CourseState, proposal: Proposal, policy: Policy | None, offers: Mapping[str, Policy]
    ) -> Action | str | None:
        """Return the human's action, or who shall have control instead, or None while the dead-man is not held.

        `policy` is what would drive from here on, None before the novice has learned anything; `offers` are the
        experts that can be given control.
        """

    def reset(self, layout: int) -> None:
        """A new episode begins, on this layout."""


@dataclass(frozen=True, slots=True)
class Sight:
    """What a decision is about: an observation that could be used, and what the networks see of it."""

    observation: Observation
    features: Features


@dataclass(frozen=True, slots=True)
class Step:
    """One pass of the loop. `state` is ground truth where there is any."""

    observation: Observation
    proposal: Proposal
    applied: Applied
    lesson: Lesson
    state: CourseState | None


def to_twist(action: Action, base: Base) -> Twist:
    """Scale an action in [-1, 1]^2 to the robot's limits, clamped."""
    linear, angular = (min(1.0, max(-1.0, a)) for a in action)
    return Twist(linear * base.max_linear_m_s, angular * base.max_angular_rad_s)


def to_action(twist: Twist, base: Base) -> Action:
    """Inverse of `to_twist`."""
    return twist.linear_m_s / base.max_linear_m_s, twist.angular_rad_s / base.max_angular_rad_s


class ControlLoop:
    """Runs a method on a robot at the profile's control rate, on the robot's own clock."""

    def __init__(self, robot: Robot, truth: Callable[[], CourseState | None] | None = None) -> None:
        self._robot = robot
        self._restartable = robot if isinstance(robot, Restartable) else None
        self._truth = truth
        self._base = robot.profile.base
        self._period_s = robot.profile.period_s
        self._deadline_s = robot.now()
        self._preprocess = Preprocessor(robot.profile)
        self._reason = Reason.OK  # why the robot did what it did last
        self._taught = False  # whether the teacher had control at the last step
        self.refused = 0  # observations that could not be used
        self.trouble = ""  # what was wrong with the newest observation

    def arm(self) -> None:
        """Send the neutral command that a stopped robot asks for before it moves, and let one period pass.

        The teacher's hand, if it was on the controls, lets go first: else it would be in charge. The command is sent
        once more if the answer is that the robot stands: a remote one says so first, and is armed by who knows it.
        """
        if self._taught:
            self._teach(None, self._robot.read().seq)
        for _ in range(2):
            stop = Command(STOP, self._robot.now(), answers=self._robot.read().seq)
            if self._robot.drive(stop).reason not in HELD:
                break
        self._keep_time()

    def keep_silent(self) -> None:
        """Command nothing before `arm`, not even to stand: that would arm a robot that stands for its own reasons."""
        self._reason = Reason.NEUTRAL_FIRST

    def step(self, method: Method, teacher: Teacher | None = None) -> Step | None:
        """Make one decision and let its period pass. Returns None if a sensor was stale or unusable: it stops then."""
        sight = self.look(method)
        return None if sight is None else self.follow(method, sight, self._propose(method, sight.features), teacher)

    def look(self, method: Method) -> Sight | None:
        """The first half of a step: see what is to be decided on. None if a sensor was stale or unusable."""
        method.update(self._robot.now())
        observation = self._robot.read()
        features = self._features(observation)
        if features is None:
            self._stand(observation)
            return None
        return Sight(observation, features)

    def follow(self, method: Method, sight: Sight, proposal: Proposal, teacher: Teacher | None = None) -> Step:
        """The second half: do what is proposed, or what the teacher does instead, learn, and let the period pass."""
        observation, state = sight.observation, self.truth()
        if teacher is not None and state is not None:
            offers = method.offers if isinstance(method, Chooser) else {}
            answer = teacher.act(state, proposal, self._driving_policy(method, proposal), offers)
            if isinstance(answer, str) and isinstance(method, Chooser):
                method.choose(answer)  # from the next step on
            self._teach(None if isinstance(answer, str) else answer, observation.seq)
        applied = self._command(proposal.command, observation.seq)
        lesson = self._learn(method, proposal, applied)
        self._keep_time()
        return Step(observation, proposal, applied, lesson, state)

    def truth(self) -> CourseState | None:
        """Where the robot really is; None where nobody knows."""
        return None if self._truth is None else self._truth()

    def restarted(self) -> bool:
        """Whether the robot was started anew since this was asked last: it stands, and its clock is another one.

        Raises `BusError` if another robot came in its place.
        """
        return self._restartable is not None and self._restartable.started_anew()

    def stand(self) -> None:
        """Let one period pass without a decision: the robot stands, unless a hand drives it."""
        self._stand(self._robot.read())

    def _stand(self, observation: Observation) -> None:
        if self._reason not in HELD:
            self._command(STAND, observation.seq)
        self._keep_time()

    def _features(self, observation: Observation) -> Features | None:
        try:
            features = self._preprocess(observation)
        except SensorError as error:
            self.refused += 1
            self.trouble = str(error)
            return None
        silent = self._preprocess.silent(observation)
        self.trouble = f"nothing new from the {' and the '.join(silent)}" if silent else ""
        return features

    def _propose(self, method: Method, features: Features) -> Proposal:
        """Ask the method. What comes of somebody's own is checked here, where its name is still known."""
        proposal: object = method.propose(features)
        if not isinstance(proposal, Proposal):
            what = f"{type(method).__module__}:{type(method).__qualname__} proposed {proposal!r}"
            raise PluginError(what, "Let `propose` return a lira.Proposal.")
        return proposal

    def _driving_policy(self, method: Method, proposal: Proposal) -> Policy | None:
        driver = proposal.choice.driver
        return None if driver == Driver.NOBODY else method.policy(driver)

    def _teach(self, action: Action | None, answers: int) -> None:
        """Drive for the scripted teacher through the same input that a gamepad uses."""
        if action is None and not self._taught:
            return
        twist = STOP if action is None else to_twist(action, self._base)
        self._robot.drive(Command(twist, self._robot.now(), Source.TELEOP, answers, released=action is None))
        self._taught = action is not None

    def _command(self, action: Action, answers: int) -> Applied:
        applied = self._robot.drive(Command(to_twist(action, self._base), self._robot.now(), answers=answers))
        self._reason = applied.reason
        return applied

    def _learn(self, method: Method, proposal: Proposal, applied: Applied) -> Lesson:
        """Learn from what was applied, not from what was wished for: nothing if the robot was held.

        What the protective field took is learned all the same: it will be there when the novice drives, too, and who
        learned to be slow where it slows, and to stand where it stops, would never get past.
        """
        if applied.source is Source.TELEOP:
            return method.learn(proposal, to_action(applied.unhindered, self._base))
        if applied.source is Source.POLICY and applied.reason is Reason.OK:
            return method.learn(proposal, None)
        return Lesson(Choice(Driver.NOBODY, STAND))

    def _keep_time(self) -> None:
        """Wait for the next absolute deadline; after a stall, start afresh instead of catching up.

        A deadline that is far ahead is one of another clock: the robot was started anew.
        """
        now_s, next_s = self._robot.now(), self._deadline_s + self._period_s
        self._deadline_s = next_s if now_s <= next_s <= now_s + 2 * self._period_s else now_s
        self._robot.wait(self._deadline_s)
