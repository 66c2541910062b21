"""Access: what a robot lets each peer do on its bus, as zenoh's access list. Pure.

Nothing is allowed that is not named here, by kind of message, direction and key. What the robot says, it says alone:
nobody else may put it, answer a query below its name, or serve its latched values. What it is told stays with it:
commands are passed on to nobody, since whoever hears one could copy what tells its commander apart.
"""

from collections.abc import Mapping
from typing import Any

from lira.hal.bus.security.keys import Role
from lira.hal.bus.topics import (
    COMMANDS,
    ESTOP,
    ESTOP_LOOK,
    ESTOP_PRESS,
    ESTOP_RELEASE,
    FROM_OPERATORS,
    INFO,
    RESET,
    TOPICS,
    named,
)
from lira.hal.rmw.tokens import ALL_BRIDGES

_PUT = ["put", "delete"]
_ASK = ["query", "liveliness_query", "declare_subscriber", "declare_liveliness_subscriber"]
_ANSWER = ["reply", "declare_queryable", "liveliness_token"]
_EVERYTHING = ["**", "**/@adv/**"]  # `**` does not reach below a part that begins with @: latched topics are there
_IN, _OUT = "ingress", "egress"


def access_list(robot: str, roles: Mapping[str, Role] | None) -> dict[str, Any]:
    """Return the list of the robot that listens. `roles` goes by the names on certificates.

    None is for a bus without keys, which cannot tell peers apart: everybody may do what operators and bridges may.
    """
    said = [topic.key for topic in TOPICS if topic not in COMMANDS]
    told = [topic.key for topic in FROM_OPERATORS]
    rules = {
        "answered": _rule([*_ASK, *_ANSWER], _OUT, [*_EVERYTHING, ALL_BRIDGES]),
        "said": _rule(_PUT, _OUT, _below(robot, *said, latched=True)),
        "listen": _rule(["declare_subscriber", *_ASK[1:]], _IN, [*_EVERYTHING, ALL_BRIDGES]),
        "look": _rule(["query"], _IN, [*_below(robot, INFO, ESTOP_LOOK, ESTOP_PRESS), f"{robot}/**/@adv/**"]),
        "operate": _rule(["query"], _IN, _below(robot, ESTOP_RELEASE, RESET)),
        "tell": _rule(_PUT, _IN, _below(robot, *told, latched=True)),
        "latch": _rule(_ANSWER, _IN, _below(robot, ESTOP.key, latched=True)),
        "press": _rule(_PUT, _IN, _below(robot, ESTOP.key)),
        "drive": _rule(["put"], _IN, _below(robot, *(topic.key for topic in COMMANDS))),
    }
    everybody = ["answered", "said", "listen", "look"]
    operator = [*everybody, "operate", "tell", "latch"]
    if roles is None:
        grants = {"everybody": [*operator, "drive"]}
    else:
        grants = {}
        for name, role in roles.items():
            own = f"drive as {name}"
            rules[own] = _rule(["put"], _IN, _below(robot, *(named(topic, name).key for topic in COMMANDS)))
            grants[name] = {
                Role.VIEWER: everybody,
                Role.OPERATOR: [*operator, own],
                Role.BRIDGE: [*everybody, "press", "latch", "drive"],
            }[role]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [{"id": name, **rule} for name, rule in rules.items()],
        "subjects": [{"id": name, **({} if roles is None else {"cert_common_names": [name]})} for name in grants],
        "policies": [{"rules": granted, "subjects": [name]} for name, granted in grants.items()],
    }


def _rule(messages: list[str], flow: str, keys: list[str]) -> dict[str, Any]:
    return {"permission": "allow", "messages": messages, "flows": [flow], "key_exprs": keys}


def _below(robot: str, *keys: str, latched: bool = False) -> list[str]:
    """Those keys below the robot's name; `latched` with where their last values are kept."""
    return [f"{robot}/{key}{end}" for key in keys for end in (["", "/@adv/**"] if latched else [""])]
