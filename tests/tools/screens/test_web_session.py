"""A session of teaching on the page, in a real browser: what its buttons ask at each stage, and what it shows."""

import threading
from contextlib import suppress

import pytest
from web_bed import browser, needs_browser, page_of_robot, wait_until

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import OPERATOR, OPERATOR_ANSWER, SESSION
from lira.hal.messages import OperatorAnswer, Request, SessionState, Stage

pytest.importorskip("aiohttp", reason="needs aiohttp: pip install 'lira-rosbot[web]'")
selenium = pytest.importorskip("selenium", reason="needs selenium: pip install 'lira-rosbot[dev]'")
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

pytestmark = [pytest.mark.slow, needs_browser]
PRESSES, NOTICED_S = 8, 6.0
HELD_S = 1.3  # a button that cannot be taken back is held for a second


class Learner:
    """Tells how a session goes, as `lira teach` does, and hears what is asked."""

    def __init__(self, bus):
        self._watch = Bus(bus.robot, connect=bus.endpoint, watch=True)
        self._asked = self._watch.reader(OPERATOR, depth=16)
        self._states, self._answers = bus.publisher(SESSION), bus.publisher(OPERATOR_ANSWER)
        self.state, self.answer = SessionState(1.0, Stage.TEACHING, "ada"), OperatorAnswer(1.0)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._tell)
        self._thread.start()

    def _tell(self):
        stamp_s = 1.0
        while not self._stop.wait(0.1):
            stamp_s += 0.1
            self._states.put(self.state, stamp_s)
            self._answers.put(self.answer, stamp_s)

    def asked(self):
        """What was asked since the last time."""
        return [received.message.request for received in self._asked.poll()]

    def is_asked(self, request, press):
        """By a press, and by it once. A page that lags is not obeyed: who sees nothing happen presses again.

        Then the first press may be heard after all.
        """
        found, presses = [], 0
        while not found and presses < PRESSES:
            press()
            presses += 1
            with suppress(AssertionError):
                found = wait_until(self.asked, timeout_s=NOTICED_S)
        assert set(found) == {request}
        assert len(found) <= presses

    def close(self):
        self._stop.set()
        self._thread.join()
        self._watch.close()


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """The page of somebody who drives, and the learner beside it."""
    with page_of_robot(tmp_path_factory.mktemp("session")) as (bus, address, _), browser() as driver:
        learner = Learner(bus)
        try:
            driver.get(address)
            wait_until(lambda: driver.execute_script("return document.body.dataset.seat") == "free")
            driver.find_element(By.ID, "drive").click()
            wait_until(lambda: driver.execute_script("return document.body.dataset.seat") == "yours")
            wait_until(lambda: text(driver, "session"), what="the session is not shown")
            yield driver, learner
        finally:
            learner.close()


@pytest.fixture
def page(shown):
    at(*shown, Stage.TEACHING)
    shown[1].asked()
    return shown


def text(driver, name):
    return driver.find_element(By.ID, name).text


def button(driver, control):
    return driver.find_element(By.CSS_SELECTOR, f'#teach [data-control="{control}"]')


def at(driver, learner, stage, **words):
    """The session is at this stage, and the page shows it."""
    learner.state = SessionState(1.0, stage, "ada", laps=2, passed=1, curve=(0.4, 0.9), **words)
    # Of judging nothing is waited for: that this robot stands, which nobody drives here, is said before it.
    said = {Stage.PROVING: "TO BE JUDGED", Stage.EXAM: "TWIN OF ITS OWN"}
    said |= {Stage.PRACTICE: "PRACTICE", Stage.READY: "READY", Stage.VERDICT: "IT PASSED"}
    if stage in said:
        wait_until(lambda: said[stage] in text(driver, "who"), what=f"{stage} is not shown")
    else:
        wait_until(lambda: not any(words in text(driver, "who") for words in said.values()), what="another stage")


def press(driver, control, held_s=0.15):
    ActionChains(driver).click_and_hold(button(driver, control)).pause(held_s).release().perform()


@pytest.mark.parametrize(
    ("control", "held_s", "request_"),
    [
        ("pause", 0.15, Request.PAUSE),
        ("save", 0.15, Request.SAVE),
        ("prove", 0.15, Request.PROVE),
        ("reset", HELD_S, Request.RESET),
        ("undo", HELD_S, Request.UNDO),
    ],
)
def test_a_button_asks_once(page, control, held_s, request_):
    driver, learner = page
    learner.is_asked(request_, lambda: press(driver, control, held_s))


@pytest.mark.parametrize("control", ["reset", "undo"])
def test_what_cannot_be_taken_back_needs_more_than_a_tap(page, control):
    driver, learner = page
    press(driver, control)
    learner.is_asked(Request.SAVE, lambda: press(driver, "save"))  # and nothing else before it


@pytest.mark.parametrize(
    ("key", "held_s", "request_"),
    [("p", 0.15, Request.PAUSE), ("v", 0.15, Request.PROVE), ("s", 0.15, Request.SAVE), ("u", HELD_S, Request.UNDO)],
)
def test_so_does_its_key(page, key, held_s, request_):
    driver, learner = page
    learner.is_asked(request_, ActionChains(driver).key_down(key).pause(held_s).key_up(key).perform)


@pytest.mark.parametrize(("control", "request_"), [("prove", Request.PROVE), ("undo", Request.UNDO)])
def test_who_has_no_pointer_presses_enter(page, control, request_):
    driver, learner = page
    driver.execute_script("arguments[0].focus()", button(driver, control))
    learner.is_asked(request_, ActionChains(driver).send_keys(Keys.ENTER).perform)
    wait_until(lambda: "held" not in (button(driver, control).get_attribute("class") or ""))


def test_the_button_that_pauses_goes_on(page):
    driver, learner = page
    learner.answer = OperatorAnswer(1.0, paused=True, count=1, words="paused: the robot stands")
    try:
        wait_until(lambda: text(driver, "pause") == "Go on")
        assert text(driver, "verdict") == "paused: the robot stands"
        assert text(driver, "who") == "PAUSED"
        learner.is_asked(Request.RESUME, lambda: press(driver, "pause"))
    finally:
        learner.answer = OperatorAnswer(1.0)
    wait_until(lambda: text(driver, "pause") == "Pause")


NAMES = [
    (Stage.PRACTICE, {}, "Prove it", "New episode"),
    (Stage.DEMONSTRATION, {}, "Prove it", "New episode"),
    (Stage.PROVING, {}, "Prove it", "New episode"),
    (Stage.EXAM, {"proven": 4, "shown": 5}, "Prove it", "New episode"),
    (Stage.JUDGING, {}, "Passed", "Failed"),
    (Stage.VERDICT, {"words": "It drove 11 of 12", "converged": True}, "Stop here", "New episode"),
]


@pytest.mark.parametrize(("stage", "words", "prove", "reset"), NAMES, ids=[stage for stage, *_ in NAMES])
def test_buttons_are_called_what_they_ask_at_each_stage(page, stage, words, prove, reset):
    driver, learner = page
    at(driver, learner, stage, **words)
    wait_until(lambda: (text(driver, "prove"), text(driver, "reset")) == (prove, reset))
    learner.is_asked(Request.PROVE, lambda: press(driver, "prove"))  # what it means is the session's to say


def test_how_it_goes_is_told_in_words(page):
    driver, learner = page
    at(driver, learner, Stage.EXAM, proven=4, shown=5, labels=37)
    wait_until(lambda: "4 of 5" in text(driver, "why"))
    assert "ada: lap 2, 1 passed" in text(driver, "session")
    assert "37 labels of yours" in text(driver, "session")
    at(driver, learner, Stage.VERDICT, words="It drove 11 of 12 unseen layouts", converged=True)
    wait_until(lambda: "It drove 11 of 12 unseen layouts" in text(driver, "why"))
    script = (
        "return document.querySelector('#taught canvas').getContext('2d').getImageData(0, 0, 40, 40).data.some(v => v)"
    )
    assert driver.execute_script(script), "the learning curve is not drawn"
