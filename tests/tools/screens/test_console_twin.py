"""The keyboard as the only teacher: on the twin, with the learner in a process of its own, for either method."""

import os
import signal
import threading
import time
from contextlib import ExitStack, contextmanager, suppress

import pytest

from lira.fusion.log.label_log import read_demonstrations
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, DECISION, INFO, OPERATOR_ANSWER
from lira.hal.messages import Source
from lira.tools.joystick.client import TeleopClient
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

os.environ["SDL_VIDEODRIVER"] = os.environ["SDL_AUDIODRIVER"] = "dummy"
pytest.importorskip("pygame", reason="needs pygame: pip install 'lira-rosbot[console]'")
from lira.tools.console.window import FPS, Keyboard

READY_S = 60.0
PUSHES = 5  # a busy machine lets a robot stop, which then waits for zero first


class Typist:
    """Holds keys down as the window would report them, from a thread."""

    def __init__(self, keyboard):
        self.keyboard, self.keys = keyboard, frozenset()

    def run(self, stop):
        while not stop.wait(1.0 / FPS):
            self.keyboard.update(self.keys)

    def hold(self, *keys):
        self.keys = frozenset(keys)


def newest(reader, condition, timeout_s=30.0):
    deadline_s = time.monotonic() + timeout_s
    while (received := reader.newest()) is None or not condition(received.message):
        assert time.monotonic() < deadline_s, received
        time.sleep(0.02)
    return received.message


@contextmanager
def typist(name, endpoint):
    stop = threading.Event()
    bus = Bus(name, connect=endpoint)
    bus.ask(INFO, timeout_s=READY_S)
    watch = Bus(name, connect=endpoint, watch=True)
    typist = Typist(Keyboard(TeleopClient(bus, watch, READY_S)))
    thread = threading.Thread(target=typist.run, args=[stop])
    thread.start()
    try:
        yield typist, watch
    finally:
        stop.set()
        thread.join()
        watch.close()
        bus.close()


def test_a_person_teaches_with_the_keyboard_alone(tmp_path):
    port = free_port()
    name, endpoint = f"typed_{port}", f"127.0.0.1:{port}"
    run = tmp_path / "run"
    twin = lira_command("twin", "--name", name, "--listen", endpoint, "--world", "line", "--renderer", "sketch")
    fusion = lira_command(
        "fusion", "--name", name, "--connect", endpoint, "--method", "hg-dagger", "--run", str(run), "--no-record"
    )
    with ExitStack() as stack:
        process = stack.enter_context(ChildProcess("the twin", twin, tmp_path / "twin.log"))
        process.wait_ready("serves world", READY_S)
        learner = stack.enter_context(ChildProcess("the learner", fusion, tmp_path / "lira.fusion.log"))
        hand, watch = stack.enter_context(typist(name, endpoint))
        decisions, applied, answers = (watch.reader(topic) for topic in (DECISION, APPLIED, OPERATOR_ANSWER))
        assert newest(decisions, lambda d: d.call == "feedback", READY_S).driver == "none"  # it waits
        for _ in range(PUSHES):
            hand.hold("space")
            newest(applied, lambda a: a.source is Source.TELEOP)
            hand.hold("space", "up")
            with suppress(AssertionError):
                newest(decisions, lambda d: d.training_steps >= 1, READY_S / PUSHES)
                break
        else:
            pytest.fail(learner.output())
        hand.hold()
        assert newest(decisions, lambda d: d.driver != "human").human is None
        hand.hold("p")
        newest(answers, lambda a: a.paused)
        hand.hold()
        learner.wait_ready("operator: paused", 10.0)
        learner.signal(signal.SIGINT)
        assert learner.wait(30.0) == 0, learner.output()
    by_hand = [d for d in read_demonstrations(run / "labels.lira") if d.source == "human"]
    assert sum(d.stored for d in by_hand) >= 30
    assert by_hand[-1].action == pytest.approx((0.5, 0.0), abs=0.02)
    assert (run / "novice.safetensors").is_file()
