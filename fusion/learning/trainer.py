"""Where training runs: in this process, or in one of its own that leaves the control loop alone.

Both take labels, run one training step when told to, and hand out the new weights at `poll`, for the caller to adopt
between two decisions. With `adopt_after_s` that happens at the first poll so long after the start, whatever the
machine's speed, so that a run on simulated time can be repeated; without, as soon as the weights are there.
"""

import math
import multiprocessing
import os
import pickle
import signal
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from typing import TYPE_CHECKING

import numpy as np

from lira.fusion.inference.architecture import Architecture, Weights
from lira.fusion.inference.build import driving
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.labels import Label
from lira.fusion.learning.novice import Trainer
from lira.fusion.preprocess import Features
from lira.hal.errors import LiraError
from lira.hal.messages import FloatArray

if TYPE_CHECKING:
    from lira.fusion.learning.learner import Learner

NICENESS = 5
EXIT_TIMEOUT_S = 2.0  # between a process's last sign of life and its exit code
SMALL = {"image": (32, 32), "scan": (8,)}  # a network to warm up with
_EARLY_S = 1e-9  # simulated time is a sum of periods and may come out this much short


@dataclass(frozen=True, slots=True)
class Beginning:
    """A network before it learns: what it is made of, and how to make its learner, which is up to whoever trains it.

    `learner` can be pickled. PyTorch is loaded where it is called, and nowhere else.
    """

    architecture: Architecture
    learner: Callable[[], "Learner"]


NewTrainer = Callable[[Beginning], Trainer]


class InlineTrainer:
    """Trains at `start`, which takes as long as a training step does. `network` drives as it does before the first."""

    def __init__(self, beginning: Beginning, *, adopt_after_s: float = 0.0) -> None:
        self._learner = beginning.learner()
        self.network: DrivingNet = driving(beginning.architecture, self._learner.weights())
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

    Returns once the process is ready, after a few seconds. `network` drives as it does before the first training step.
    """

    def __init__(self, beginning: Beginning, *, adopt_after_s: float | None = None) -> None:
        self._adopt_after_s = adopt_after_s
        self._due_s = 0.0
        self._held: list[Label] = []  # while a step runs nobody reads the pipe
        self.pending = False
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._shared = _SharedWeights(context, beginning.architecture)
        # Pickled here: multiprocessing would share the memory of tensors between the processes.
        arguments = (pickle.dumps(beginning.learner), theirs, self._shared)
        self._process = context.Process(target=_serve, args=arguments, name="lira-trainer", daemon=True)
        # Ctrl-C reaches every process of the terminal; the trainer's end is its parent's to decide.
        resource_tracker.ensure_running()  # which the first start does else, and that unblocks the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()
        self._receive()
        self.network: DrivingNet = driving(beginning.architecture, self._shared.read())

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
        self._receive()
        self.pending = False
        self._hand_over()
        return self._shared.read()

    def close(self) -> None:
        """End the process at once: it holds nothing that is not in the log. May be called twice."""
        self._pipe.close()
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

    def _receive(self) -> None:
        """Wait for word from the process: that there are weights, at first those that it begins with."""
        try:
            self._pipe.recv()
        except (EOFError, ConnectionResetError) as error:
            self._process.join(EXIT_TIMEOUT_S)
            raise LiraError(
                f"the trainer process has died (exit code {self._process.exitcode})",
                "Start again: the demonstration log has every label.",
            ) from error


class _SharedWeights:
    """Weights in memory that two processes share: through the pipe, megabytes would keep the control loop waiting."""

    def __init__(self, context: SpawnContext, architecture: Architecture) -> None:
        self._shapes = architecture.weights
        self._memory = context.RawArray("f", sum(map(math.prod, self._shapes.values())))

    def write(self, weights: Weights) -> None:
        np.concatenate([weights[name].ravel() for name in self._shapes], out=self._flat())

    def read(self) -> Weights:
        sizes = [math.prod(shape) for shape in self._shapes.values()]
        parts = np.split(self._flat().copy(), np.cumsum(sizes)[:-1])
        return {name: part.reshape(self._shapes[name]) for name, part in zip(self._shapes, parts, strict=True)}

    def _flat(self) -> FloatArray:
        return np.frombuffer(self._memory, np.float32)


def _serve(pickled: bytes, pipe: Connection, shared: _SharedWeights) -> None:
    """Keep labels and train until the other end of the pipe is closed. None asks for a training step."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the owner ends this process
    os.nice(NICENESS)
    one_thread()
    learner: Learner = pickle.loads(pickled)()
    _warm_up()
    try:
        shared.write(learner.weights())
        pipe.send(None)  # ready
        while True:
            label = pipe.recv()
            if label is not None:
                learner.add(label)
                continue
            learner.train_step()
            shared.write(learner.weights())
            pipe.send(None)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def _warm_up() -> None:
    """Train a small network for nothing: PyTorch loads much of itself at the first step, which takes seconds."""
    from lira.fusion.learning.learner import Learner
    from lira.fusion.policies.networks import FusionNet

    learner = Learner(FusionNet(SMALL, filters=4), updates=1, seed=0, frozen_trunks=False)
    nothing = Features(**{name: np.zeros(shape, np.float32) for name, shape in SMALL.items()})
    learner.add(Label(nothing, (0.0, 0.0), "none"))
    learner.train_step()
