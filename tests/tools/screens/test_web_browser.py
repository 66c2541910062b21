"""A real browser drives a robot by touch, keys and a pad; however its page is lost, the robot stands in time."""

import contextlib
import os
import signal
import time

import pytest
from web_bed import Applied, browser, descendants, needs_browser, page_of_robot, wait_until

from lira.hal.messages import HELD, Source

pytest.importorskip("aiohttp", reason="needs aiohttp: pip install 'lira-rosbot[web]'")
selenium = pytest.importorskip("selenium", reason="needs selenium: pip install 'lira-rosbot[dev]'")
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

pytestmark = [pytest.mark.slow, needs_browser]
REST_S = 0.6  # the bridge looks for a pad three times a second, and the hand has to be seen at rest
LONGEST_S = 0.35  # from the last command until the wheels have zero
FAKE_PAD = """
window.pad = { id: "A pad (STANDARD)", connected: true, mapping: "standard", axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
navigator.getGamepads = () => [window.pad];
"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with page_of_robot(tmp_path_factory.mktemp("web")) as made:
        yield made


@pytest.fixture(scope="module")
def chromium():
    with browser() as driver:
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": FAKE_PAD})
        yield driver


@pytest.fixture
def page(robot, chromium):
    yield opened(chromium, robot[1])
    chromium.get("about:blank")


@pytest.fixture
def applied(robot):
    return Applied(robot[0])


def opened(driver, address):
    driver.get(address)
    wait_until(lambda: who(driver), what="the page shows nothing")
    wait_until(lambda: seat(driver) == "free", what="the seat is not free")
    return driver


def who(driver):
    return driver.find_element(By.ID, "who").text


def seat(driver):
    return driver.execute_script("return document.body.dataset.seat")


def sit(driver):
    driver.find_element(By.ID, "drive").click()
    wait_until(lambda: seat(driver) == "yours")
    time.sleep(REST_S)


def drives(page, hold, steer, let_go, applied, what):
    """The hand drives. On a busy machine it may lose its seat, or the policy may pause, and what stopped is held.

    So it is at rest on its deadman before it steers, and begins again, as a person does.
    """
    for _ in range(4):
        hold()
        applied.listen(REST_S)
        steer()
        with contextlib.suppress(AssertionError):
            return wait_until(applied.by_hand, 5.0)
        let_go()
        if seat(page) != "yours":
            wait_until(lambda: seat(page) == "free", what="the seat is not free")
            sit(page)
    focused = page.execute_script("return document.hasFocus()")
    says = f"the page says '{who(page)}', the seat is {seat(page)}, it has the focus: {focused}, and {applied.all[-1:]}"
    raise AssertionError(f"{what}; {says}")


def hands_back(drive, let_go, applied):
    """The hand drives and lets go, and the policy drives on. On a busy machine that one may have paused meanwhile.

    What stopped is held, until a hand has driven again.
    """
    for _ in range(4):
        drive()
        let_go()
        with contextlib.suppress(AssertionError):
            return wait_until(lambda: applied.listen()[-1].source is Source.POLICY, 5.0)
        assert applied.all[-1].reason in HELD, f"control did not go back to the policy: {applied.all[-1]}"
    raise AssertionError("the policy was held each time")


def keys(driver, applied):
    hold, steer = (ActionChains(driver).key_down(key).perform for key in (Keys.SPACE, Keys.ARROW_UP))
    let_go = ActionChains(driver).key_up(Keys.SPACE).key_up(Keys.ARROW_UP).perform
    drives(driver, hold, steer, let_go, applied, "the keys do not drive")


def points(driver, *names):
    """Middle of these elements, a little up for the stick."""
    found = []
    for index, name in enumerate(names):
        box = driver.find_element(By.ID, name).rect
        lift = 0.4 * box["height"] if name == "stick" else 0.0
        found.append({"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2 - lift, "id": index})
    return found


def touch(driver, kind, touched):
    driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touched})


def test_keys_drive_and_let_go(page, applied):
    def drive():
        keys(page, applied)
        assert wait_until(lambda: who(page) == "YOU DRIVE")

    sit(page)
    hands_back(drive, ActionChains(page).key_up(Keys.SPACE).key_up(Keys.ARROW_UP).perform, applied)


def test_two_thumbs_drive_and_lifted_let_go(page, applied):
    def hold():
        touch(page, "touchStart", points(page, "deadman"))

    def steer():
        touch(page, "touchStart", points(page, "deadman", "stick"))

    def let_go():
        touch(page, "touchEnd", [])

    sit(page)
    hands_back(lambda: drives(page, hold, steer, let_go, applied, "thumbs do not drive"), let_go, applied)


def test_a_pad_in_the_browser_drives_and_its_loss_stops(page, applied):
    def hold():
        page.execute_script("pad.buttons[4].pressed = true;")

    def steer():
        page.execute_script("pad.axes[1] = -1;")

    def let_go():
        page.execute_script("pad.axes[1] = 0; pad.buttons[4].pressed = false;")

    sit(page)
    drives(page, hold, steer, let_go, applied, "the pad does not drive")
    assert page.find_element(By.ID, "pad").text.endswith("A pad")
    page.execute_script("navigator.getGamepads = () => [null];")
    wait_until(lambda: not applied.by_hand())
    let_go()
    page.execute_script("navigator.getGamepads = () => [pad];")


def hide(driver, _):
    driver.switch_to.new_window("tab")


def hang(driver, _):
    driver.execute_cdp_cmd(
        "Runtime.evaluate",
        {"expression": "setTimeout(() => { const t = Date.now(); while (Date.now() - t < 3000); }, 0)"},
    )


def close(driver, _):
    old = driver.current_window_handle
    driver.switch_to.new_window("tab")
    new = driver.current_window_handle
    driver.switch_to.window(old)
    driver.close()
    driver.switch_to.window(new)


def blur(driver, _):
    driver.execute_script("window.dispatchEvent(new Event('blur'))")


def reload(driver, _):
    driver.execute_script("location.reload()")


def freeze(driver, _):
    """As a phone that is locked: nothing of this browser runs any more."""
    pids = descendants(driver.service.process.pid)
    assert pids, "the browser has no processes"
    for number in (signal.SIGSTOP, signal.SIGCONT):
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)
        time.sleep(1.5)


def cut(driver, web):
    """As a WiFi that is gone, and comes back: what was said meanwhile comes late, all at once."""
    web.signal(signal.SIGSTOP)
    time.sleep(1.0)
    web.signal(signal.SIGCONT)


@pytest.mark.parametrize("lose", [hide, hang, close, blur, reload, freeze, cut], ids=lambda lose: lose.__name__)
def test_however_the_page_is_lost_the_robot_stands_and_no_policy_takes_over(robot, chromium, lose):
    applied = Applied(robot[0])
    page = opened(chromium, robot[1])
    sit(page)
    keys(page, applied)
    applied.listen(0.3)
    lose(page, robot[2])
    applied.listen(2.0)
    assert applied.zero_after_s() <= LONGEST_S
    stood = next(index for index, each in reversed(list(enumerate(applied.all))) if each.source is Source.TELEOP)
    assert not any(each.twist.linear_m_s for each in applied.all[stood + 1 :]), "somebody else drove on"
    for other in chromium.window_handles[1:]:
        chromium.switch_to.window(other)
        chromium.close()
    chromium.switch_to.window(chromium.window_handles[0])
    chromium.get("about:blank")


def test_who_only_looks_can_stop_and_the_driver_can_release(robot, page, applied):
    page.find_element(By.ID, "stop").click()
    wait_until(lambda: who(page) == "EMERGENCY STOP")
    wait_until(lambda: "says that it stands" in page.find_element(By.ID, "why").text, what="the robot did not confirm")
    sit(page)
    ActionChains(page).key_down(Keys.F1).perform()
    wait_until(lambda: who(page) != "EMERGENCY STOP", what="F1 does not release")
    ActionChains(page).key_up(Keys.F1).perform()


SIZES = {
    "phone": (390, 844),
    "phone lying": (844, 390),
    "tablet": (820, 1180),
    "netbook": (1024, 600),
    "laptop": (1366, 768),
    "4K": (3840, 2160),
}


NEEDED = ("who", "now", "stop", "deadman", "stick", "turbo", "pause", "drive", "camera")
BOXES = "return arguments[0].map((name) => document.getElementById(name).getBoundingClientRect().toJSON());"


def test_on_every_screen_all_that_is_needed_is_in_reach(page):
    sit(page)
    try:
        for size, (width, height) in SIZES.items():
            words = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": "phone" in size}
            page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", words)
            wait_until(lambda: page.execute_script("return [innerWidth, innerHeight]") == [width, height])  # noqa: B023
            for name, box in zip(NEEDED, page.execute_script(BOXES, NEEDED), strict=True):
                assert box["width"] > 20, (size, name)
                assert box["height"] > 10, (size, name)
                assert -1 <= box["left"] <= box["right"] <= width + 1, (size, name)
                assert -1 <= box["top"] <= box["bottom"] <= height + 1, (size, name)
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


CONTRAST = """
const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
const luminance = (colour) => {
  const [r, g, b] = colour.match(/[\\d.]+/g).map((v) => linear(v / 255));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const behind = (element) => {
  const colour = getComputedStyle(element).backgroundColor;
  const clear = /^rgba.*, 0\\)$/.test(colour);
  return element === document.documentElement || !clear ? colour : behind(element.parentElement);
};
const contrast = (element) => {
  const [one, other] = [getComputedStyle(element).color, behind(element)].map(luminance).sort((a, b) => a - b);
  return (other + 0.05) / (one + 0.05);
};
const found = {};
const said = ["#who", "#why", "#now", "#stop b", "figcaption", "h2", "#drive", "#link", ".none", "#deadman small"];
for (const urgency of ["idle", "calm", "watch", "ask", "need", "alarm"]) {
  document.body.dataset.urgency = urgency;
  for (const selector of said) found[`${urgency} ${selector}`] = contrast(document.querySelector(selector));
}
document.querySelector("#turbo").classList.add("held");
found["held"] = contrast(document.querySelector("#turbo b"));
document.querySelector("#turbo").classList.remove("held");
return found;
"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_letters_can_be_read_in_daylight_and_in_the_dark(page, scheme):
    """WCAG AA: 4.5 to 1, for whatever is said and however loud."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    try:
        found = page.execute_script(CONTRAST)
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert {name: ratio for name, ratio in found.items() if ratio < 4.5} == {}


def test_the_page_shows_pictures_soon_and_without_an_error(page):
    wait_until(lambda: int(page.execute_script("return document.body.dataset.pictures || 0")) > 3, 5.0)
    assert [line for line in page.get_log("browser") if line["level"] == "SEVERE"] == []
