import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from lessons import labels

from lira.fusion.learning.trainer import Beginning, InlineTrainer, ProcessTrainer
from lira.hal.errors import LiraError

WAIT_S = 60.0  # for what is certain to come; only a hang takes that long


def beginning(updates: int = 50) -> Beginning:
    from nets import lidar_net  # with torch, which whoever waits does without

    from lira.fusion.learning.learner import Learner

    network = lidar_net(101)
    return Beginning(network.architecture, partial(Learner, network, seed=1, frozen_trunks=False, updates=updates))


def process_trainer(**settings):
    return ProcessTrainer(beginning(), **settings)


@pytest.fixture(scope="module")
def real_time():
    trainer = process_trainer()
    yield trainer
    trainer.close()


def wait_for_weights(trainer):
    deadline = time.monotonic() + WAIT_S
    while time.monotonic() < deadline:
        if (weights := trainer.poll(time.monotonic())) is not None:
            return weights
        time.sleep(0.005)
    raise AssertionError("no weights")


def lockstep(trainer, steps: int = 24) -> dict[int, dict[str, np.ndarray]]:
    """Decide at 5 Hz of simulated time, train at every eighth step; which step adopted what."""
    adopted = {}
    try:
        for k, label in enumerate(labels(steps)):
            now_s = 0.2 * k
            if (weights := trainer.poll(now_s)) is not None:
                adopted[k] = weights
            trainer.add(label)
            if k % 8 == 7:
                trainer.start(now_s)
                assert trainer.pending
    finally:
        trainer.close()
    return adopted


def test_both_trainers_adopt_the_same_weights_at_the_same_steps():
    inline = lockstep(InlineTrainer(beginning(), adopt_after_s=0.6))
    process = lockstep(process_trainer(adopt_after_s=0.6))
    assert list(inline) == list(process) == [10, 18]
    for k, weights in inline.items():
        for name, value in weights.items():
            np.testing.assert_array_equal(process[k][name], value)


def test_inline_training_is_ready_at_once():
    trainer = InlineTrainer(beginning())
    trainer.add(labels(1)[0])
    assert trainer.poll(0.0) is None
    trainer.start(5.0)
    assert trainer.poll(4.9) is None
    assert trainer.poll(5.0) is not None
    assert trainer.poll(5.0) is None
    assert not trainer.pending


def test_weights_come_when_ready_while_labels_keep_coming(real_time):
    assert real_time.poll(0.0) is None
    for label in labels(40):
        real_time.add(label)
    real_time.start(0.0)
    for label in labels(500, seed=2):  # more than a pipe holds
        real_time.add(label)
    assert real_time.pending
    first = wait_for_weights(real_time)
    assert not real_time.pending
    assert real_time.poll(0.0) is None
    real_time.start(0.0)
    second = wait_for_weights(real_time)
    assert not np.array_equal(first["trunk.fc1.weight"], second["trunk.fc1.weight"])


def test_the_process_gives_way_and_is_deaf_to_ctrl_c(real_time):
    assert os.getpriority(os.PRIO_PROCESS, real_time.pid) > os.getpriority(os.PRIO_PROCESS, 0)
    os.kill(real_time.pid, signal.SIGINT)
    real_time.add(labels(1)[0])
    real_time.start(0.0)
    assert wait_for_weights(real_time)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.parametrize("adopt_after_s", [None, 0.4])
def test_a_trainer_that_dies_is_reported_at_the_next_poll(adopt_after_s):
    trainer = process_trainer(adopt_after_s=adopt_after_s)
    try:
        made = labels(2)
        trainer.add(made[0])
        os.kill(trainer.pid, signal.SIGKILL)
        trainer._process.join(WAIT_S)
        trainer.add(made[1])
        trainer.start(0.0)
        with pytest.raises(LiraError, match=r"died \(exit code -9\)") as died:
            trainer.poll(1.0)
        assert "log" in died.value.remedy
    finally:
        trainer.close()


def test_closing_in_the_middle_of_a_long_training_step_is_bounded():
    trainer = ProcessTrainer(beginning(updates=10**6))
    trainer.add(labels(1)[0])
    trainer.start(0.0)
    began = time.monotonic()
    trainer.close()
    assert time.monotonic() - began < 10.0
    assert not trainer._process.is_alive()
    trainer.close()


OWNER = """
import os, signal, sys, threading, time
from lira.fusion.learning.novice import LearningSettings
from lira.fusion.learning.trainer import ProcessTrainer
from lira.hal.profile import load_profile
from lira.tools.runs.build import load_pair
from lira.tools.runs.network_novice import network_novice

signal.signal(signal.SIGINT, lambda *_: None)
ready = threading.Event()

def press():
    while not ready.wait(0.05):
        os.killpg(0, signal.SIGINT)

threading.Thread(target=press).start()
experts = [network for network, _ in load_pair(load_profile("thesis-sim"))]
how = {"frozen": True, "mirrored": False, "ensemble": 0}
novice = network_novice(experts, LearningSettings(), ProcessTrainer, 0, **how)
ready.set()
print(novice._trainer.pid, "torch" in sys.modules, flush=True)
time.sleep(600)
"""


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_the_process_does_not_hear_ctrl_c_while_it_starts_goes_with_its_parent_and_alone_loads_torch():
    words, pipe = [sys.executable, "-c", OWNER], subprocess.PIPE
    owner = subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, start_new_session=True)
    pid, loaded = owner.stdout.readline().split()
    assert loaded == "False"
    pid = int(pid)
    assert is_running(pid)
    owner.kill()
    assert owner.communicate(timeout=WAIT_S)[1] == ""
    deadline = time.monotonic() + WAIT_S
    while is_running(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(pid)
