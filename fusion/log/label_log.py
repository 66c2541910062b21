"""The demonstration log: every label with what was seen, in one append-only file.

A stored label survives `kill -9`: each record is one write to the kernel. The file is synced to the disk when it is
closed, not at every label, which could stall the control loop: a power cut can cost what the kernel still holds.

Nothing that was stored is deleted. Opening a damaged log finds every whole record (`label_salvage.py`), goes on with
a clean file of these, and keeps the damaged one beside it.
"""

import errno
import itertools
import os
import shutil
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from lira.fusion.log.label_file import Demonstration as Demonstration
from lira.fusion.log.label_file import Format, read_format
from lira.fusion.log.label_salvage import Damage, Survey, beside, find_format, heal, lock, pieces, survey
from lira.hal.config import open_regular
from lira.hal.errors import StorageError
from lira.hal.profile import RobotProfile
from lira.hal.words import plural

# Told to the user while there is still room for this many labels, so that none is lost before the disk is full.
RESERVE = 256
_APPENDING = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK  # nobody waits for the other end of a pipe


class DemonstrationLog:
    """The writing end. `count` records were good when it was opened, `repaired_bytes` of a torn tail were cut off.

    `run` is the number of this opening; `mirrored` says how the stored labels are learned. Nothing is kept in memory.
    `say` gets a line when the log turns out to be damaged, and when somebody takes the file away or cuts it: then it
    goes on in a new one, with all that can still be read.
    Raises `StorageError` when the file is another robot's, no log, in use by another process, or cannot be written.
    """

    def __init__(
        self, path: Path, profile: RobotProfile, *, mirrored: bool = False, say: Callable[[str], None] = print
    ) -> None:
        self.path = path
        self._mirrored = mirrored
        self._say = say
        self._format = Format.of(profile)
        self._unwritten: list[bytes] = []
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, _APPENDING, 0o644)
        except OSError as error:
            raise StorageError(f"cannot open {path}: {error.strerror}", "Choose another folder.") from error
        try:
            lock(self._file, path)
            found = self._recover()
            self.count, self.run, self.repaired_bytes = found.count, found.newest_run + 1, found.torn_bytes
            self._end = os.fstat(self._file).st_size
            if self._end == 0:
                self._write(self._format.header())
            self._check_space()
        except BaseException:
            os.close(self._file)
            raise

    def append(self, record: Demonstration) -> None:
        """Store a label.

        Raises `StorageError` when the disk is nearly full, though this label is stored, and when it is full or fails:
        then the label is kept in memory and written before the next one.
        """
        record = replace(record, run=self.run, mirrored=self._mirrored and record.stored)
        self._unwritten.append(self._format.encode(record))
        self._drain()
        self._check_space()

    def sync(self) -> None:
        """Wait until every label is on the disk itself. May be called from any thread. Raises `StorageError`."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """Write what is left, sync and unlock. Raises `StorageError` if labels could not be written."""
        if self._file < 0:
            return
        try:
            self._drain()
            os.fsync(self._file)
        except OSError as error:
            raise self._failed(error) from error
        finally:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> "DemonstrationLog":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _drain(self) -> None:
        self._look()
        while self._unwritten:
            self._write(self._unwritten[0])
            del self._unwritten[0]

    def _write(self, data: bytes) -> None:
        """Write all of it or nothing."""
        written = 0
        try:
            while written < len(data):  # after a short write the next one says why
                written += os.write(self._file, data[written:])
        except OSError as error:
            os.ftruncate(self._file, self._end)
            raise self._failed(error) from error
        self._end += written

    def _failed(self, error: OSError) -> StorageError:
        what = f"cannot write to {self.path}: {error.strerror}"
        return StorageError(
            f"{what}; in memory: {plural(len(self._unwritten), 'label')}", "Free some space on that disk."
        )

    def _check_space(self) -> None:
        disk = os.fstatvfs(self._file)
        free = disk.f_bavail * disk.f_frsize
        if free < RESERVE * self._format.record_bytes:
            raise StorageError(f"the disk of {self.path} is nearly full: {free // 1024} kB", "Free some space on it.")

    def _look(self) -> None:
        """Notice when the file was taken away or cut: what is written from now on has to be found later."""
        own = os.fstat(self._file)
        try:
            taken = not os.path.samestat(own, self.path.stat())
        except OSError:
            taken = True
        if taken:
            self._move()
        elif own.st_size != self._end:
            self._say(
                f"{self.path} was changed by somebody else: it has {own.st_size} bytes instead of {self._end}; "
                "labels may be lost, those from now on are written behind what is there"
            )
            self._end = own.st_size
            if self._end < len(self._format.header()):
                os.ftruncate(self._file, 0)
                self._end = 0
                self._write(self._format.header())

    def _move(self) -> None:
        """Go on in a new file, with all that the old one holds: it is there as long as it is open."""
        before = self.path
        try:
            before.parent.mkdir(parents=True, exist_ok=True)
            self.path, new = _create(before)
            lock(new, self.path)
            os.lseek(self._file, 0, os.SEEK_SET)
            with os.fdopen(self._file, "rb", closefd=False) as old, os.fdopen(new, "wb", closefd=False) as copy:
                shutil.copyfileobj(old, copy)
        except OSError as error:
            raise self._failed(error) from error
        os.close(self._file)
        self._file, self._end = new, os.fstat(new).st_size
        self._say(f"somebody took {before} away while it was written; all labels are in {self.path}")

    def _recover(self) -> Survey:
        """Find what is in the file, and leave only whole records in it. Raises `StorageError` for one to keep off."""
        header, size = self._format.header(), _size(self._file, self.path)
        with self.path.open("rb") as file:
            if header.startswith(file.read(len(header) + 1)) and size < len(header):
                found = Survey(self._format, torn_bytes=size)  # new, or torn in its very first write
            else:
                file.seek(0)
                form = read_format(file, self.path)
                if form != self._format:
                    raise StorageError(
                        f"{self.path} holds demonstrations for {form.words()}, not for {self._format.words()}",
                        f"Start the robot with --profile {form.profile}, or give a new file for this one.",
                    )
                self._format = form  # an older one goes on as it is
                found = survey(file, form, file.tell())
            if found.lost_bytes > 0:
                clean, kept = heal(file, found, self.path)
                os.close(self._file)
                self._file = clean
                self._say(
                    f"{self.path}: {found.words()}; {plural(found.count, 'label')} read, the old file is kept as {kept}"
                )
            else:
                os.ftruncate(self._file, found.end)
        return found


def read_demonstrations(path: Path) -> Iterator[Demonstration]:
    """Stream the whole labels of a log, one at a time, whatever is damaged between them; the log may be in use.

    Each is stored, or not, as its last correction has it. A label that was damaged comes from its correction.
    Raises `StorageError` for a file that is missing, no log, or whose header is damaged.
    """
    stored = {record.key: record.stored for record in read_records(path) if record.correction}
    met = set()
    for record in read_records(path):
        if record.key in stored and record.key not in met:
            met.add(record.key)
            now = stored[record.key]
            undone = (record.stored or record.correction) and not now
            yield replace(record, stored=now, undone=undone, correction=False)
        elif not record.correction:
            yield record


def read_records(path: Path) -> Iterator[Demonstration]:
    """Stream what is in a log as it is, corrections among the labels. Raises what `read_demonstrations` raises."""
    try:
        with open_regular(path) as file:
            form = read_format(file, path)
            for piece in pieces(file, form, file.tell()):
                if not isinstance(piece, Damage):
                    yield piece[1]
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error


def check_log(path: Path, robots: Sequence[RobotProfile] = ()) -> Survey:
    """Look through a whole log; `robots` say what a record may look like where the header is damaged.

    Raises `StorageError` for a file that is missing or no log.
    """
    try:
        with open_regular(path) as file:
            return survey(file, *find_format(file, path, [Format.of(robot) for robot in robots]))
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error


def repair_log(path: Path, robots: Sequence[RobotProfile] = ()) -> tuple[Survey, Path | None]:
    """Put a clean log in the place of a damaged one; returns what was found, and where the old one is kept, if any.

    Raises `StorageError`, also while somebody writes to the log.
    """
    try:
        with open_regular(path) as file:
            lock(file.fileno(), path)
            found = check_log(path, robots)
            if not found.words():
                return found, None
            clean, kept = heal(file, found, path)
            os.close(clean)
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error
    return found, kept


def _create(path: Path) -> tuple[Path, int]:
    """Make a new file of this name, or of one like it where that is taken."""
    for name in itertools.chain((path,), beside(path, "new")):
        with suppress(FileExistsError):
            return name, os.open(name, _APPENDING | os.O_EXCL, 0o644)
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))


def _size(file: int, path: Path) -> int:
    """Size of an open file. Raises `StorageError` for a pipe or a device."""
    status = os.fstat(file)
    if not stat.S_ISREG(status.st_mode):
        raise StorageError(f"{path} is no file", "Give the path of a log of labels, or of a new file.")
    return status.st_size
