"""The recorder: hears everything on the bus, and hands it to a thread that writes. Neither waits for the other."""

import shutil
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import RawSample, Tap
from lira.hal.bus.services import ask_info
from lira.hal.bus.topics import APPLIED, CLOCK
from lira.hal.errors import BusError, CodecError, LiraError, StorageError
from lira.tools.recording.backlog import Backlog
from lira.tools.recording.layout import Head
from lira.tools.recording.timeline import TimeLine
from lira.tools.recording.writer import RecordingWriter

POLL_S = 0.005
FLUSH_S = 0.5  # what is younger may be lost when the process is killed
LOOK_S = 2.0  # between two looks at the disk
FIRST_S = 5.0
UNIX_NS = 1_000_000_000
LAST_S = 0.3  # so long it listens on when it is told to end: what was sent before is still under way
WARN_S = 600.0  # of recording that the disk has room for
SPARE_BYTES = 200 * 2**20  # are left to others: labels must not be lost to pictures

Say = Callable[[str], None]


def listen(bus: Bus, version: str, command: str, stop: threading.Event) -> tuple[Head, Tap, list[RawSample]]:
    """Find out what the bus is of, and when its robot's clock began. Returns that, and what was heard meanwhile.

    Raises `BusError` if no robot answers.
    """
    tap = bus.tap()
    info = ask_info(bus, FIRST_S)
    heard: list[RawSample] = []
    local_ns = time.time_ns() - time.monotonic_ns()
    until_s = time.monotonic() + FIRST_S
    while time.monotonic() < until_s and not stop.is_set():
        heard += tap.poll()
        for sample in heard:
            sent = attachment_of(sample)
            if sent is not None and sent.epoch == info.epoch and sample.key in (APPLIED.key, CLOCK.key):
                offset_ns = round(sample.arrived_s * 1e9) + local_ns - sent.time_ns
                if abs(offset_ns) < UNIX_NS:
                    offset_ns = 0  # the robot tells Unix time, and this message was so long under way
                began_ns = round(heard[0].arrived_s * 1e9) + local_ns
                return Head(bus.robot, version, offset_ns, began_ns, info, command), tap, heard
        time.sleep(POLL_S)
    raise BusError(f"the robot '{bus.robot}' answers and sends nothing", "Check that it runs: lira console shows it.")


class Recorder:
    """Records what `tap` hears into `writer` until told to stop.

    `say` gets a line when something was lost, when the disk runs full and when it ends for that.
    """

    def __init__(self, tap: Tap, writer: RecordingWriter, head: Head, say: Say, *, most_bytes: int) -> None:
        self._tap, self._writer, self._say = tap, writer, say
        self._backlog = Backlog(most_bytes)
        local_ns = time.time_ns() - time.monotonic_ns()
        self._line = TimeLine(head.offset_ns, local_ns, lockstep=head.lockstep)
        self._lock = threading.Lock()  # over the backlog
        self._told: Counter[str] = Counter()
        self._warned = False
        self._began_s = time.monotonic()
        self._ended = threading.Event()
        self.count = 0
        self.failure: LiraError | None = LiraError("the recorder failed", "Tell us what is written above.")

    @property
    def lost(self) -> Counter[str]:
        """How many messages were not recorded, by key."""
        with self._lock:
            return self._backlog.lost.copy()

    def run(self, stop: threading.Event, heard: list[RawSample], alive: Callable[[], None] = lambda: None) -> None:
        """Record until `stop` is set; `alive` is called with every turn. Raises `StorageError` if the disk is full.

        And `LiraError` if the writing thread ended by a fault of its own.
        """
        clerk = threading.Thread(target=self._write, name="recorder", daemon=True)
        self._push(heard)
        clerk.start()
        while not stop.wait(POLL_S) and clerk.is_alive():
            alive()
            self._push(self._tap.poll())
        until_s = time.monotonic() + LAST_S
        while time.monotonic() < until_s and clerk.is_alive():
            self._push(self._tap.poll())
            time.sleep(POLL_S)
        self._ended.set()
        clerk.join()
        if self.failure is not None:
            raise self.failure

    def _push(self, samples: list[RawSample]) -> None:
        with self._lock:
            for sample in samples:
                self._backlog.push(sample)
            if self._tap.full:
                self._backlog.lost["**"] += 1

    def _write(self) -> None:
        try:
            with self._writer:
                failure = self._write_until_ended()
            self.failure = failure
        except OSError as error:
            self.failure = StorageError(f"the recording ends: {error.strerror}", "Free some space, and start again.")

    def _write_until_ended(self) -> StorageError | None:
        """Write what comes. Returns why it ended before it was told to."""
        flush_s = look_s = time.monotonic()
        ended = False
        while not ended:
            ended = self._ended.wait(POLL_S)  # asked before what waits is taken: that is all then
            self._add(self._taken())
            now_s = time.monotonic()
            if now_s >= flush_s:
                flush_s = now_s + FLUSH_S
                self._writer.flush()
            if now_s >= look_s:
                look_s = now_s + LOOK_S
                self._tell_losses()
                if not self._has_room():
                    return StorageError(
                        f"no room is left for more, and the recording ends: {self._writer.folder} has less than "
                        f"{SPARE_BYTES >> 20} MB left, which are kept for labels; what was recorded stays",
                        "Free some space, and start again.",
                    )
        self._tell_losses()
        return None

    def _taken(self) -> list[RawSample]:
        with self._lock:
            return self._backlog.take()

    def _add(self, samples: list[RawSample]) -> None:
        for sample in samples:
            sent = attachment_of(sample)
            log_ns, publish_ns = self._line.times(sample.arrived_s, sent)
            self._writer.add(sample, log_ns, publish_ns, 0 if sent is None else sent.seq)
        self.count += len(samples)

    def _tell_losses(self) -> None:
        lost = self.lost
        if lost == self._told:
            return
        new = ", ".join(f"{count} of {key}" for key, count in sorted((lost - self._told).items()))
        self._say(f"not recorded, the disk is too slow: {new}")
        self._writer.note_losses(dict(lost), time.time_ns())
        self._told = lost

    def _has_room(self) -> bool:
        """Whether to go on; says so once when the room for it comes to an end, and how much time is in what is left."""
        free = free_bytes(self._writer.folder)
        if free <= SPARE_BYTES:
            return False
        rate = self._writer.size_bytes / max(time.monotonic() - self._began_s, 1.0)
        left_s = (free - SPARE_BYTES) / max(rate, 1.0)
        if not self._warned and left_s < WARN_S:
            self._warned = True
            self._say(f"the disk has {free / 2**30:.1f} GB left: room for {left_s / 60:.0f} min more of this")
        return True


def attachment_of(sample: RawSample) -> Attachment | None:
    """Read what rode beside a message; None for what is not ours or out of bounds, which is recorded all the same."""
    try:
        return parse_attachment(sample.attachment)
    except CodecError:
        return None


def free_bytes(folder: Path) -> int:
    """Room on the disk of a folder."""
    return shutil.disk_usage(folder).free
