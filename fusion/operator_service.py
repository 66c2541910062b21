"""What a person asks of the service, from the pad or the console: pause, go on, start afresh, save, give control.

Requests are answered between two decisions, each with one line that is printed and sent back. None of them touches
the governor: the emergency stop and the person's hand work whatever is asked here.
"""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from lira.fusion.control import ControlLoop
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Chooser, Method
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import OPERATOR, OPERATOR_ANSWER
from lira.hal.errors import LiraError
from lira.hal.messages import OperatorAnswer, OperatorRequest, Request

DEPTH = 16
ONLY_IN_A_SESSION = frozenset({Request.PROVE, Request.PASSED, Request.FAILED, Request.UNDO, Request.FINISH})

Answer = tuple[bool, str]
"""Whether a request was accepted, and what to say about it."""

Job = Callable[[], str]
"""Work beside the loop that ends with what to say about it. Raises `LiraError`."""


class RequestLine:
    """The bus side: requests come over `watch`, a watching bus, for peers do not hear one another."""

    def __init__(self, bus: Bus, watch: Bus, now: Callable[[], float]) -> None:
        self._asked = watch.reader(OPERATOR, DEPTH)
        self._answers = bus.publisher(OPERATOR_ANSWER)
        self._now = now

    def poll(self) -> list[tuple[OperatorRequest, bool]]:
        """Requests since the last time, and whether each came in time. One without a time is judged by its arrival."""
        now_s = self._now()
        sent = [(received.message, received.attachment) for received in self._asked.poll()]
        # Far ahead is a time of another clock, from before the robot was started anew.
        return [(asked, at is None or abs(now_s - at.time_s) <= OPERATOR.max_age_s) for asked, at in sent]

    def put(self, *, paused: bool, count: int, accepted: bool, words: str) -> None:
        """Send the newest answer, again now and then for who has come since."""
        now_s = self._now()
        self._answers.put(OperatorAnswer(now_s, paused, count, accepted, words), now_s)


class OperatorService:
    """Does what is asked between two steps of `loop`. `paused` and `episode` are what the service goes by.

    `restart` puts a twin's robot back to the start; None on a real floor. `snapshot` takes what is to be saved as it is
    now and returns the writing of it, which is done aside; None where nothing is learned. `session` is asked first: it
    answers what it takes, None to the rest. Who begins `paused` arms nothing: the robot stands until a person asks it
    to go on.
    """

    def __init__(
        self,
        line: RequestLine,
        loop: ControlLoop,
        method: Method,
        journal: Journal,
        say: Callable[[str], None],
        *,
        restart: Callable[[], None] | None = None,
        snapshot: Callable[[], Job] | None = None,
        session: Callable[[OperatorRequest], Answer | None] = lambda _: None,
        paused: bool = False,
    ) -> None:
        self.paused = paused
        self.episode = 0
        self._line = line
        self._boundary = Boundary()
        self._loop = loop
        self._method = method
        self._journal = journal
        self._say = say
        self._restart = restart
        self._snapshot = snapshot
        self._session = session
        self._clerk = ThreadPoolExecutor(max_workers=1, thread_name_prefix="save")
        self._saving: Future[str] | None = None
        self._count = 0
        self._newest = (True, "")

    def begin(self) -> None:
        """Arm the robot for the first time; who begins paused says nothing to it."""
        if self.paused:
            self._loop.keep_silent()
        else:
            self._loop.arm()

    def serve(self) -> None:
        """Answer what was asked since the last time, and what has been saved by now."""
        for asked, in_time in self._line.poll():
            with self._boundary.guard(OPERATOR.key):
                if not in_time:
                    self._answer(False, f"{asked.request} came too late: ask again")
                elif asked.request is Request.SAVE:
                    self._begin_to_save()
                else:
                    self._answer(*self._do(asked))
        if self._saving is not None and self._saving.done():
            self._end_saving(self._saving)
        self._show()

    def close(self) -> None:
        """Finish what is being saved, and answer."""
        self._clerk.shutdown(wait=True)
        if self._saving is not None:
            self._end_saving(self._saving)

    def _do(self, asked: OperatorRequest) -> Answer:
        taken = self._session(asked)
        if taken is not None:
            return taken
        if asked.request in ONLY_IN_A_SESSION:
            return False, "only a session of teaching can: lira teach"
        if asked.request is Request.PAUSE:
            self.paused = True
            return True, "paused: the robot stands unless a hand drives, and nothing is learned"
        if asked.request is Request.RESUME:
            if self.paused:
                self.paused = False
                self._begin_anew()
            return True, "it drives and learns again"
        if asked.request is Request.RESET:
            return self._reset()
        return self._choose(asked.name)

    def _reset(self) -> Answer:
        where = "begins here"
        if self._restart is not None:
            self._loop.stand()
            try:
                self._restart()
            except LiraError as error:
                return False, f"not reset: {error}"
            where = "begins, back at the start"
        self.episode += 1
        self._begin_anew()
        return True, f"episode {self.episode} {where}"

    def change_method(self, method: Method) -> None:
        """From now on it is another method that drives."""
        self._method = method

    def _begin_anew(self) -> None:
        """Nothing of what was before belongs to what comes; the robot moves after a neutral command."""
        self._method.reset()
        self._journal.ledger.new_episode()
        if not self.paused:
            self._loop.arm()

    def _choose(self, name: str) -> tuple[bool, str]:
        if not isinstance(self._method, Chooser):
            return False, "this method gives no expert control"
        if self.paused:
            return False, "paused: nobody drives"
        refusal = self._method.choose(name)
        return refusal is None, refusal or f"{name} drives"

    def _begin_to_save(self) -> None:
        if self._snapshot is None:
            self._answer(False, "nothing is learned here, so nothing is saved")
        elif self._saving is None:
            self._saving = self._clerk.submit(self._snapshot())

    def _end_saving(self, saving: Future[str]) -> None:
        self._saving = None
        try:
            self._answer(True, saving.result())
        except LiraError as error:
            self._answer(False, f"not saved: {error}")

    def _answer(self, accepted: bool, words: str) -> None:
        self._count += 1
        self._newest = accepted, words
        self._say(f"operator: {words}")
        self._show()

    def _show(self) -> None:
        accepted, words = self._newest
        self._line.put(paused=self.paused, count=self._count, accepted=accepted, words=words)
