"""The second half of a proof: layouts that nobody has seen, in a twin of its own, as fast as the machine can.

A minute of driving takes a second or two there, so that many layouts can be shown while a person waits. It is in step
with its twin: what a busy machine or a link adds in real time is proven by the first half, on the robot itself.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event
from typing import Self

from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, Record
from lira.fusion.methods.base import Method
from lira.fusion.teaching.ride import Drive
from lira.fusion.teaching.session import Session
from lira.hal.messages import Phase
from lira.hal.profile import RobotProfile
from lira.sim_backend.scenes.opening import quickest
from lira.sim_backend.world import World
from lira.tools.runs.simulated import simulate


class Exam:
    """Has a method's novice drive alone, from a thread; a context that ends it early. What it does goes into the
    `journal`'s record, and is not published: it is not the robot on the bus that drives.
    """

    def __init__(
        self, profile: RobotProfile, world: World, method: Method, drives: Sequence[Drive], journal: Journal
    ) -> None:
        self._profile, self._world, self._method, self._drives = profile, world, method, drives
        self._journal = journal.aside(self._note)
        self._write = journal.write
        self._enough = Event()
        self._pool = ThreadPoolExecutor(1, "exam")
        self._end: Future[None] | None = None
        self._laps: list[LapRecord] = []

    @property
    def laps(self) -> Sequence[LapRecord]:
        """What came of those that were driven so far."""
        return tuple(self._laps)

    @property
    def goes_on(self) -> bool:
        """Whether it still drives. Raises what went wrong."""
        assert self._end is not None
        if self._end.done():
            self._end.result()
            return False
        return True

    def __enter__(self) -> Self:
        self._end = self._pool.submit(self._run)
        return self

    def __exit__(self, *_: object) -> None:
        self._enough.set()
        self._pool.shutdown()

    def _run(self) -> None:
        with simulate(self._world, self._profile, renderer=quickest(self._world)) as robot:
            alone = self._method.alone(Phase.UNSEEN)
            Session(robot, robot.arena, self._journal, self._method, lambda _: alone).show(self._left())

    def _left(self) -> Iterator[Drive]:
        for drive in self._drives:
            if self._enough.is_set():
                return
            yield drive

    def _note(self, record: Record) -> None:
        self._write(record)
        if isinstance(record, LapRecord):
            self._laps.append(record)
