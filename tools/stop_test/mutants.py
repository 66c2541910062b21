"""The product, broken in known ways: each a small patch inside a process under test, with the rows that it has to fail.

`lira stop-test --mutants` tries them. A patch that no longer finds what it replaces is an error: it proves nothing.
"""

import math
import os
import signal
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

from lira.hal.errors import LiraError
from lira.hal.messages import Reason, Source

FOREVER_S = 1e9
PATIENT_S = 2.0


class MutantError(LiraError):
    """A mutant that is none: what it breaks is not there."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One way to break the product, in the processes of the "robot", "policy" or both. `rows` have to fail by it.

    `trials` of each: what costs a few hundredths of a second does not show in every one.
    """

    name: str
    break_: Callable[[], None]
    rows: tuple[str, ...]
    where: tuple[str, ...] = ("robot",)
    trials: int = 1


def break_product(name: str) -> None:
    """Break it in this way, in this process. Raises `MutantError` if that is not possible any more."""
    mutant = next((mutant for mutant in MUTANTS if mutant.name == name), None)
    if mutant is None:
        raise MutantError(f"there is no mutant '{name}'", f"There are: {'; '.join(one.name for one in MUTANTS)}.")
    mutant.break_()


def swap(owner: Any, name: str, new: Any) -> Any:
    """Put something else in the place of an attribute; returns what was there. Raises `MutantError` if nothing was."""
    if not hasattr(owner, name):
        raise MutantError(f"{owner} has no '{name}' any more", "Write this mutant anew.")
    old = getattr(owner, name)
    setattr(owner, name, new)
    return old


def after(owner: Any, name: str, then: Callable[..., Any]) -> None:
    """Call `then(result, *arguments)` after a method, and return what that does."""
    old = swap(owner, name, None)
    setattr(owner, name, lambda *words, **named: then(old(*words, **named), *words, **named))


def before(owner: Any, name: str, first: Callable[..., Any]) -> None:
    """Call `first` with the arguments before a method."""
    old = swap(owner, name, None)

    def run(*words: Any, **named: Any) -> Any:
        first(*words, **named)
        return old(*words, **named)

    setattr(owner, name, run)


def rewrite(*changes: tuple[str, str, str]) -> Callable[[], None]:
    """Change the governor's table: in this state, this event leads to that state, and motion is allowed there."""

    def break_() -> None:
        from lira.hal.safety.arming import TRANSITIONS, State

        keys = {(str(state), str(event)): (state, event) for state, event in TRANSITIONS}
        for state, event, then in changes:
            if (state, event) not in keys:
                raise MutantError(f"the table of arming has no {event} of {state}", "Write this mutant anew.")
            TRANSITIONS[keys[state, event]] = (State(then), Reason.OK)

    return break_


def without_objection(*reasons: str) -> Callable[[], None]:
    """Refuse no command for these reasons."""

    def break_() -> None:
        from lira.hal.safety.governor import Governor

        after(Governor, "_objection", lambda objection, *_: None if objection in reasons else objection)

    return break_


def constant(module: str, name: str, value: float) -> Callable[[], None]:
    """Change a number of the product."""

    def break_() -> None:
        swap(import_module(module), name, value)

    return break_


def obey_by_arrival() -> None:
    """Take every command for as young as its arrival."""
    from lira.hal.safety.governor import Governor

    old = swap(Governor, "submit", None)
    setattr(Governor, "submit", lambda governor, command, now_s: old(governor, replace(command, stamp_s=now_s), now_s))  # noqa: B010


def obey_repeats() -> None:
    """Take what was said before for something new."""
    swap(import_module("lira.hal.server.command_reader").Order, "is_new", lambda *_: True)
    obey_by_arrival()


def wait_longer() -> None:
    """Let a command drive for two seconds."""
    from lira.hal.safety.governor import Governor

    def lengthen(_: None, governor: Any, *__: Any) -> None:
        swap(governor, "_timeouts_s", dict.fromkeys(governor._timeouts_s, PATIENT_S))

    after(Governor, "__init__", lengthen)


def let_policy_take_over() -> None:
    """Take a hand that falls silent for one that let go."""
    from lira.hal.safety.governor import Governor

    def forgive(governor: Any, now_s: float, grace_s: float) -> None:
        hand = governor._live.get(Source.TELEOP)
        if hand is not None and now_s - hand.stamp_s >= governor._timeouts_s[Source.TELEOP] + grace_s:
            governor._live[Source.TELEOP] = replace(hand, released=True)

    before(Governor, "_expire", forgive)


def sleep_on_watch() -> None:
    """Look at the time-outs only when a command comes."""
    from lira.hal.safety.governor import Governor

    old = swap(Governor, "_expire", None)
    setattr(Governor, "_expire", lambda *words: old(*words) if words[-1] > 0.0 else None)  # noqa: B010


def obey_nonsense() -> None:
    """Take what is not a number for a velocity."""
    from lira.hal.safety import governor

    swap(governor, "_is_finite", lambda _: True)


def see_through() -> None:
    """Let the protective field allow everything."""
    from lira.hal.safety import governor

    swap(governor, "limit_speed", lambda *words: (words[2], ""))


def never_time_out_in_the_base() -> None:
    """Let the base's driver repeat a command for ever."""
    from lira.robot.core2.device import Core2

    def lengthen(_: None, base: Any, *__: Any) -> None:
        swap(base, "_until_s", math.inf)

    after(Core2, "drive", lengthen)


def freeze_the_guard() -> None:
    """Let the guard never strike."""
    from lira.robot.core2.watchdog import WatchdogProcess

    after(WatchdogProcess, "__init__", lambda _, guard, *__: os.kill(guard._process.pid, signal.SIGSTOP))


def run_ahead() -> None:
    """Let a client believe that it is later than it is."""
    from lira.hal.clock import ClockEstimate

    after(ClockEstimate, "now", lambda now_s, *_: now_s + 0.09)


def arm_by_an_idle_hand() -> None:
    """Take the zero of a hand that has let go for a wish to drive."""
    from lira.hal.safety.arming import Event
    from lira.hal.safety.governor import Governor

    def arm(_: None, governor: Any, command: Any, *__: Any) -> None:
        if command.source is Source.TELEOP and command.released:
            governor._fire(Event.NEUTRAL)

    after(Governor, "_accept", arm)


def never_miss_a_device() -> None:
    """Let the governor hear of no device that is lost."""
    from lira.hal.safety.governor import Governor

    swap(Governor, "note_devices", lambda *_: None)


def poll_for_ever() -> None:
    """Read all there is of a topic, however much comes meanwhile, and all of it."""
    bus = import_module("lira.hal.bus.bus")
    old = swap(bus.Bus, "reader", None)
    bus.Bus.reader = lambda self, topic, *_: old(self, replace(topic, max_bytes=1 << 30), 1 << 15)
    swap(import_module("lira.hal.bus.zenoh_session"), "_size_limits", lambda *_: [])


def tell_epochs() -> None:
    """Tell everybody the very number by which a commander's session is known."""
    for module in ("lira.hal.safety.governor", "lira.hal.client.realtime"):
        swap(import_module(module), "session_of", lambda epoch: epoch)


def trust_names() -> None:
    """Let every operator command in whatever name it likes."""

    def widen(access: dict[str, Any], robot: str, *_: Any) -> dict[str, Any]:
        own = [rule for rule in access["rules"] if rule["id"].startswith("drive as")]
        if not own:
            raise MutantError("nobody on the access list drives in an own name", "Write this mutant anew.")
        for rule in own:
            rule["key_exprs"] = [f"{robot}/cmd_vel/by/*"]
        return access

    after(import_module("lira.hal.bus.zenoh_session"), "access_list", widen)


def promote_viewers() -> None:
    """Take every viewer for an operator."""
    keys = import_module("lira.hal.bus.security.keys")
    after(keys, "load_roles", lambda roles, *_: roles and dict.fromkeys(roles, keys.Role.OPERATOR))


def keep_expired_links() -> None:
    """Let a link live longer than the certificate that it was opened with."""
    from lira.hal.bus.security.keys import Keys

    after(Keys, "link_config", lambda config, *_: config | {"close_link_on_expiration": False})


def never_read_keys_again() -> None:
    """Believe for ever who was enrolled at the start."""
    from lira.hal.bus.security.keys import Keys

    swap(Keys, "changed", lambda _: False)


MUTANTS = (
    Mutant(
        "neutral-first is skipped",
        rewrite(("stopped", "motion", "armed"), ("disarmed", "motion", "armed")),
        ("black-out of 1 s", "commander frozen (SIGSTOP)", "commands of nan", "emergency stop"),
    ),
    Mutant("a second commander is obeyed", without_objection("another commander"), ("second commander",)),
    Mutant("an old epoch is obeyed", without_objection("old epoch"), ("commander with an old epoch",)),
    Mutant(
        "any neutral command leaves the emergency stop",
        rewrite(("emergency", "neutral", "armed")),
        ("emergency stop under motion and neutrals",),
    ),
    Mutant("releasing the emergency stop arms", rewrite(("emergency", "released", "armed")), ("emergency stop",)),
    Mutant("age counts from arrival", obey_by_arrival, ("link delayed more and more",)),
    Mutant("a repeat is obeyed", obey_repeats, ("commands recorded and replayed",)),
    Mutant("late commands are taken", without_objection("late", "out of order"), ("stamps an hour behind",)),
    Mutant("commands of three seconds ahead are obeyed", constant("lira.hal.safety.governor", "AHEAD_S", 3.0),
           ("stamps half a second ahead",)),
    Mutant("the client's clock runs ahead", run_ahead, ("link delayed more and more",), where=("policy",), trials=4),
    Mutant("the time-out is two seconds", wait_longer, ("commander frozen (SIGSTOP)", "black-out of 1 s")),
    Mutant("the watchdog sleeps", sleep_on_watch, ("commander frozen (SIGSTOP)", "black-out of 1 s")),
    Mutant("a hand that falls silent lets go", let_policy_take_over, ("hand's bridge killed (kill -9)",)),
    Mutant("what is not a number is obeyed", obey_nonsense, ("commands of nan",)),
    Mutant("the protective field sees nothing", see_through, ("lidar freezes, and the commander drives on",)),
    Mutant("a loop that hangs is kept alive", constant("lira.hal.client.realtime", "DECISION_S", FOREVER_S),
           ("commander's loop hangs",), where=("policy",)),
    Mutant("the base's driver repeats for ever", never_time_out_in_the_base, ("robot's governor hangs",)),
    Mutant("the guard never strikes", freeze_the_guard, ("robot's process frozen (SIGSTOP)",)),
    Mutant("an idle hand arms", arm_by_an_idle_hand,
           ("emergency stop beside an idle ROS joystick", "commander frozen beside an idle ROS joystick")),
    Mutant("a silent board is told to go on", constant("lira.robot.core2.contact", "SILENCE_S", 1.0),
           ("board heard no more",)),
    Mutant("a lost device is not missed", never_miss_a_device, ("board reset, up after 1.1 s",)),
    Mutant("a device that is back arms", rewrite(("lost", "found", "armed")), ("board reset, up after 1.1 s",)),
    Mutant("a poll has no end", poll_for_ever, ("flood of commands",)),
    Mutant("a commander's session is no secret", tell_epochs, ("lease copied",), where=("robot", "policy")),
    Mutant("a name is what its sender says", trust_names, ("put in the commander's name with another's certificate",)),
    Mutant("a viewer may do all", promote_viewers, ("emergency stop released by a viewer",)),
    Mutant("links outlive their certificates", keep_expired_links, ("certificate runs out",)),
    Mutant("who is revoked stays", never_read_keys_again, ("name revoked",)),
)  # fmt: skip
