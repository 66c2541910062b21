"""Other settings for a run that is gone through again: `theta=0.06`, or another method by name."""

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from lira.fusion.methods.presets import Preset, method_named
from lira.hal.errors import ConfigError
from lira.tools.runs.plan import Recipe

Path = tuple[str, ...]


def changed(recipe: Recipe, method: str | None, changes: Sequence[str]) -> Recipe | None:
    """Return a recipe by another method, with settings `NAME=VALUE`; None if nothing is changed.

    Raises `ConfigError` for a method or a setting that there is none of, and for a value that it cannot have.
    """
    if method is None and not changes:
        return None
    preset = recipe.preset
    if method is not None:
        learning = msgspec.structs.replace(method_named(method).learning, idle_frames=preset.learning.idle_frames)
        preset = msgspec.structs.replace(method_named(method), learning=learning)
    for change in changes:
        preset = with_setting(preset, change)
    return msgspec.structs.replace(recipe, preset=preset, missing="" if method is not None else recipe.missing)


def with_setting(preset: Preset, change: str) -> Preset:
    """Return a preset with one setting changed: its name, or more of its path where several have that name."""
    name, equals, text = change.partition("=")
    if not equals:
        raise ConfigError(f"'{change}' is no NAME=VALUE", "Such as: --set theta=0.06")
    plain = msgspec.to_builtins(preset)
    wanted = tuple(name.strip().split("."))
    found = [path for path in paths(plain) if path[-len(wanted) :] == wanted]
    if len(found) != 1:
        known = ", ".join(".".join(path) for path in (found or paths(plain)) if path[-1] not in ("type", "name"))
        what = f"'{preset.name}' has no setting '{name}'" if not found else f"'{name}' may be several settings"
        raise ConfigError(what, f"Choose one of: {known}.")
    inner = plain
    for part in found[0][:-1]:
        inner = inner[part]
    inner[found[0][-1]] = value_of(text)
    try:
        return msgspec.convert(plain, Preset)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{name} cannot be '{text}': {error}", "Give a value of its kind.") from error


def paths(plain: dict[str, Any], above: Path = ()) -> Iterator[Path]:
    """Yield the path of every value."""
    for name, value in plain.items():
        if isinstance(value, dict):
            yield from paths(value, (*above, name))
        else:
            yield (*above, name)


def value_of(text: str) -> Any:
    """Read a value: a number, true, false, null or a list as JSON has them, else a word."""
    try:
        return msgspec.json.decode(text)
    except msgspec.DecodeError:
        return text
