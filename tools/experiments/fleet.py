"""Several robots in one world, each in a twin of its own, that drive abreast: what all of them see is decided at once.

A network that is asked about twelve observations reads its weights once. Robots do not see each other, and a lap comes
out the same, but for rounding, whatever drives beside it.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from lira.fusion.control import ControlLoop
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord
from lira.fusion.methods.base import Method
from lira.fusion.teaching.ride import Drive, Place, Ride, Tally, abreast
from lira.hal.messages import Phase
from lira.hal.profile import RobotProfile
from lira.sim_backend.scenes.opening import quickest
from lira.sim_backend.world import World
from lira.tools.runs.simulated import SimulatedRobot, simulate


class Fleet:
    """Drives as many laps at once as it has robots."""

    def __init__(self, robots: Sequence[SimulatedRobot]) -> None:
        self._robots = robots
        self._loops = [ControlLoop(robot, truth=robot.arena.state) for robot in robots]
        for loop in self._loops:
            loop.arm()

    def drive(
        self,
        method: Method,
        drives: Sequence[Drive],
        phase: Phase,
        lap: int,
        journals: Sequence[Journal],
        apprentice: Method | None = None,
    ) -> list[LapRecord]:
        """Let a method drive one lap on each robot, none of which the others see; `journals` has one for each.

        A method that cannot drive several robots at once drives one after the other. Raises `DeviceError`.
        """
        seats = list(zip(self._robots, self._loops, drives, journals, strict=False))
        records: list[LapRecord] = []
        for group in [seats] if method.drives_several else [[seat] for seat in seats]:
            rides = [
                Ride(Place(robot, robot.arena, loop, journal), method, drive, phase, lap, Tally(), apprentice)
                for robot, loop, drive, journal in group
            ]
            abreast(rides, method)
            records += [ride.record() for ride in rides]
        return records


@contextmanager
def fleet(world: World, profile: RobotProfile, count: int) -> Iterator[Fleet]:
    """Open so many robots, and close them in the end. Sensors that are not exact err otherwise in each."""
    with ExitStack() as stack:
        robots = [
            stack.enter_context(simulate(world, profile, seed=number, renderer=quickest(world)))
            for number in range(count)
        ]
        yield Fleet(robots)
