"""Where training runs: in this process, or in one of its own that leaves the control loop alone.

Both take labels, run one training step when told to, and hand out the new weights at `poll`, for the caller to adopt
between two decisions. With `adopt_after_s` that happens at the first poll so long after the start, whatever the
machine's speed, so that a run on simulated time can be repeated; without, as soon as the weights are there.
"""

import multiprocessing
import os
import pickle
import signal
from multiprocessing.connection import Connection

import torch

from fusion.learner import Label, Learner
from fusion.networks import Weights
from hal.errors import LiraError

NICENESS = 5
CLOSE_TIMEOUT_S = 2.0
_EARLY_S = 1e-9  # simulated time is a sum of periods and may come out this much short


class InlineTrainer:
    """Trains at `start`, which takes as long as a training step does."""

    def __init__(self, learner: Learner, *, adopt_after_s: float = 0.0) -> None:
        self._learner = learner
        self._adopt_after_s = adopt_after_s
        self._weights: Weights | None = None
        self._due_s = 0.0

    @property
    def pending(self) -> bool:
        """Whether weights are still to be adopted."""
        return self._weights is not None

    def add(self, label: Label) -> None:
        """Keep one label."""
        self._learner.add(label)

    def start(self, now_s: float) -> None:
        """Run one training step. Raises `ValueError` without labels."""
        self._learner.train_step()
        self._weights = self._learner.weights()
        self._due_s = now_s + self._adopt_after_s - _EARLY_S

    def poll(self, now_s: float) -> Weights | None:
        """Return new weights once, when they are due."""
        if self._weights is None or now_s < self._due_s:
            return None
        weights, self._weights = self._weights, None
        return weights

    def close(self) -> None:
        """Nothing to end."""


class ProcessTrainer:
    """Trains in a process of its own, on one thread and with low priority.

    Takes over the learner with all that it holds. Returns once the process is ready, after a few seconds.
    """

    def __init__(self, learner: Learner, *, adopt_after_s: float | None = None) -> None:
        self._adopt_after_s = adopt_after_s
        self._due_s = 0.0
        self._held: list[Label] = []  # while a step runs nobody reads the pipe
        self.pending = False
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        # Pickled here: multiprocessing would share the tensors' memory between the processes.
        self._process = context.Process(
            target=_serve, args=(pickle.dumps(learner), theirs), name="lira-trainer", daemon=True
        )
        # Ctrl-C reaches every process of the terminal; the trainer's end is its parent's to decide.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()
        self._receive()

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid or 0

    def add(self, label: Label) -> None:
        """Hand over one label."""
        self._held.append(label)
        if not self.pending:
            self._hand_over()

    def start(self, now_s: float) -> None:
        """Begin one training step."""
        self._due_s = now_s + (self._adopt_after_s or 0.0) - _EARLY_S
        self._send(None)
        self.pending = True

    def poll(self, now_s: float) -> Weights | None:
        """Return new weights once, when they are due. Raises `LiraError` when the process has died."""
        due = self.pending and self._adopt_after_s is not None
        if now_s < self._due_s if due else not self._pipe.poll():
            return None
        weights = self._receive()
        self.pending = False
        self._hand_over()
        return weights

    def close(self) -> None:
        """End the process, in bounded time."""
        self._pipe.close()
        self._process.join(CLOSE_TIMEOUT_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _hand_over(self) -> None:
        for label in self._held:
            self._send(label)
        self._held.clear()

    def _send(self, message: Label | None) -> None:
        """What a dead process misses is in the demonstration log; its death is reported at the next poll."""
        try:
            self._pipe.send(message)
        except BrokenPipeError:
            return

    def _receive(self) -> Weights | None:
        try:
            weights: Weights | None = self._pipe.recv()
        except (EOFError, ConnectionResetError) as error:
            self._process.join(CLOSE_TIMEOUT_S)
            raise LiraError(
                f"the trainer process has died (exit code {self._process.exitcode})",
                "Start again: the demonstration log has every label.",
            ) from error
        return weights


def _serve(pickled: bytes, pipe: Connection) -> None:
    """Keep labels and train until the other end of the pipe is closed. None asks for a training step."""
    os.nice(NICENESS)
    torch.set_num_threads(1)
    learner: Learner = pickle.loads(pickled)
    pipe.send(None)  # ready
    try:
        while True:
            label = pipe.recv()
            if label is None:
                learner.train_step()
                pipe.send(learner.weights())
            else:
                learner.add(label)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
