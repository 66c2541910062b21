"""The whole way: a scripted person teaches `line-obstacles` to a pass with `lira teach`, by a pad and by the page.

It sees what a person beside the twin sees, and its only way to the robot are the events of a pad, or a browser's page.
"""

import contextlib
import json
import threading
import time

import pytest
from fingers import Fingers
from kinds import LONG, TAKES_LONG
from pad_bed import SONY, Bed, library
from web_bed import browser, needs_browser, wait_until

from lira.fusion.log.run_log import VerdictRecord, read_run
from lira.hal.bus.bus import Bus
from lira.hal.messages import Driver
from lira.hal.profile import load_profile
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.live.scripted_person import live, person_for
from lira.tools.report.digest import load_run

WORLD, SPEED = "line-obstacles", 1.5
PAD = 5
READY_S, WHOLE_S = 90.0, 600.0
LONGEST_S = 2 * (READY_S + WHOLE_S)
pytestmark = [
    *(pytest.mark.slow, pytest.mark.alone, pytest.mark.timeout(LONGEST_S)),
    pytest.mark.skipif(not LONG, reason=TAKES_LONG),
]
MIDDLE, REACH = 128, 127
FAKE_PAD = """
window.pad = { id: "A pad (STANDARD)", connected: true, mapping: "standard", axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
navigator.getGamepads = () => [window.pad];
"""


class Session:
    """`lira teach` for a hand on a twin of its own, in a folder."""

    def __init__(self, folder, stack) -> None:
        port = free_port()
        self.name, self.endpoint, self.folder = f"taught_{port}", f"127.0.0.1:{port}", folder / "run"
        words = ["--as", "ada", "--world", WORLD, "--speed", str(SPEED), "--practice", "2", "--run", str(self.folder)]
        words += ["--name", self.name, "--listen", self.endpoint]
        self.process = stack.enter_context(ChildProcess("the session", lira_command("teach", *words), folder / "log"))
        self.process.wait_ready(f"drive '{self.name}'", READY_S)
        self.words = ["--name", self.name, "--connect", self.endpoint]
        self.watch = Bus(self.name, connect=self.endpoint, watch=True)
        stack.callback(self.watch.close)

    def is_taught_by(self, put, button) -> None:
        """A scripted person with these fingers teaches until the session is over; it has passed."""
        person = person_for(load_profile("thesis-sim"), WORLD, 0, "scripted", 0)
        stop = threading.Event()
        watcher = threading.Timer(WHOLE_S, stop.set)
        watcher.start()
        try:
            with Fingers(self.watch, put, button) as fingers:
                live(fingers, self.watch, person, 0.2, SPEED, stop)
        finally:
            watcher.cancel()
            person.close()
        assert self.process.wait(READY_S) == 0, self.process.output()
        [verdict] = [record for record in read_run(self.folder / "run.jsonl") if isinstance(record, VerdictRecord)]
        assert (verdict.person, verdict.passed) == ("ada", True)
        run = load_run(self.folder / "run.jsonl")
        assert any(step.decision.driver == Driver.HUMAN for _, step in run.steps())
        assert verdict.words in (self.folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.skipif(library() is None, reason="needs libumockdev (Debian package umockdev)")
def test_a_person_with_a_pad_teaches_to_a_pass(tmp_path):
    with contextlib.ExitStack() as stack:
        session, bed = Session(tmp_path, stack), Bed(tmp_path)
        stack.callback(bed.close)
        bed.plug(4, f"{SONY} Motion Sensors", motion=True)
        bed.plug(PAD)
        command = [*bed.environment, *lira_command("joystick", *session.words)]
        bridge = stack.enter_context(ChildProcess("the bridge", command, tmp_path / "bridge.log"))
        bridge.wait_ready("ready: hold the dead-man", READY_S)
        shown = {}

        def say(name, value, write):
            if shown.get(name) != value:
                shown[name] = value
                write(PAD, name, value)

        def put(held, forward, turn):
            for name in ("BTN_TR", "BTN_TL"):
                say(name, int(held), bed.key)
            say("ABS_Y", round(MIDDLE - REACH * forward), bed.axis)
            say("ABS_X", round(MIDDLE - REACH * turn), bed.axis)

        session.is_taught_by(put, lambda pressed: say("BTN_SOUTH", int(pressed), bed.key))


@needs_browser
def test_a_person_on_the_page_teaches_to_a_pass(tmp_path):
    pytest.importorskip("aiohttp", reason="needs aiohttp: pip install 'lira-rosbot[web]'")
    pytest.importorskip("selenium", reason="needs selenium: pip install 'lira-rosbot[dev]'")
    with contextlib.ExitStack() as stack:
        session, port = Session(tmp_path, stack), free_port()
        command = lira_command("web", *session.words, "--port", str(port))
        web = stack.enter_context(ChildProcess("lira web", command, tmp_path / "web.log"))
        web.wait_ready("web shows", READY_S)
        driver = stack.enter_context(browser())
        driver.set_window_size(480, 600)  # whoever draws without a graphics card takes less of the machine
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": FAKE_PAD})
        driver.get(f"http://127.0.0.1:{port}")

        def seat():
            return driver.execute_script("return document.body.dataset.seat")

        wait_until(lambda: seat() == "free")
        driver.find_element("id", "drive").click()
        wait_until(lambda: seat() == "yours")
        time.sleep(0.6)  # the bridge looks for a pad three times a second, and the hand has to be seen at rest
        state = {"held": False, "axes": [0.0, 0.0], "button": False}
        script = "const s = JSON.parse(arguments[0]); [pad.axes[0], pad.axes[1]] = s.axes; "
        script += "for (const k of [4, 5]) pad.buttons[k].pressed = s.held; pad.buttons[0].pressed = s.button;"

        told = ""

        def put(held, forward, turn):
            nonlocal told
            state.update(held=held, axes=[-turn, -forward])
            if (words := json.dumps(state)) != told:
                driver.execute_script(script, words)
            told = words

        session.is_taught_by(put, lambda pressed: state.update(button=pressed))
