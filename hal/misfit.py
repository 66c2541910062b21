"""What is wrong with a file that somebody wrote, in words, and what would be right: msgspec's errors for people."""

import re
from typing import Any

from msgspec import inspect

from lira.hal.errors import ConfigError, did_you_mean

COMPARE = "Compare the file with the ones that come with the project."
KINDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
_KIND = "|".join((*KINDS, "null"))
_KIND_NAMES = re.compile(rf"`((?:{_KIND})(?: \| (?:{_KIND}))*)`")
_PLACE = re.compile(r" - at `\$\.?(.*)`$")
_STEP = re.compile(r"(\w+)|\[[^]]*\]")
_UNKNOWN = re.compile(r"Object contains unknown field `(.*?)`")
_EXPECTED = re.compile("Expected (.*), got ")
_MISSING = re.compile(r"Object missing required field `(.*?)`")


def misfit(error: Exception, kind: Any, where: str) -> ConfigError:
    """Return an error that says what in `where` does not fit `kind`, and what would.

    msgspec's message ends with the place, such as "- at `$.line.width_m`".
    """
    message = str(error)
    place = found[1] if (found := _PLACE.search(message)) else ""
    remedy = COMPARE
    if unknown := _UNKNOWN.search(message):
        remedy = _suggestion(unknown[1], _keys_at(kind, place)) or COMPARE
    message = _PLACE.sub(f" - at `{place}`" if place else "", message)
    message = _MISSING.sub(r"`\1` is missing", _UNKNOWN.sub(r"unknown key `\1`", message))
    message = _KIND_NAMES.sub(_kinds, message)
    if expected := _EXPECTED.match(message):
        remedy = f"Write {expected[1]} there."
    return ConfigError(f"{where}: {message}", remedy)


def _kinds(names: re.Match[str]) -> str:
    """A list of msgspec's names as people would say it."""
    return " or ".join(KINDS[name] for name in names[1].split(" | ") if name in KINDS) or "nothing"


def _suggestion(key: str, known: list[str]) -> str:
    """The key that was meant, if there is one like it, or those that there are."""
    return did_you_mean(key, known) or (f"Known here: {', '.join(known)}." if known else "")


def _keys_at(kind: Any, place: str) -> list[str]:
    """The keys of the table at a place such as `box[0].size`; none where that cannot be told."""
    at: Any = inspect.type_info(kind)
    for step in _STEP.finditer(place):
        at = _within(at, step[1])
    at = _one_of(at, inspect.StructType)
    return [field.encode_name for field in at.fields] if at else []


def _within(at: Any, key: str | None) -> Any:
    """The type of a table's entry, or of a list's."""
    if key is None:
        several = _one_of(at, inspect.ListType | inspect.VarTupleType)
        return several and several.item_type
    table = _one_of(at, inspect.StructType)
    return table and next((field.type for field in table.fields if field.encode_name == key), None)


def _one_of(at: Any, wanted: Any) -> Any:
    """A type, or the one of a choice, that is of this sort; else None."""
    choices = at.types if isinstance(at, inspect.UnionType) else (at,)
    return next((each for each in choices if isinstance(each, wanted)), None)
