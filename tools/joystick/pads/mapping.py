"""Which control of a pad does what: a small TOML file, checked when it loads."""

from importlib import resources
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from lira.hal.config import Table, load_toml
from lira.hal.errors import ConfigError
from lira.tools.joystick.pads.codes import AXES, BUTTONS, axis_of, is_control

Share = Annotated[float, Meta(ge=0.0, le=1.0)]


class Axis(Table, frozen=True):
    """An axis by its kernel name; `inverted` if it reads low where the robot counts positive."""

    axis: str
    inverted: bool = False


class Mapping(Table, frozen=True):
    """One kind of pad. Controls go by their names in linux/input-event-codes.h; see `pads/ps3.toml` for what each does.

    Where a button is asked for, an end of an axis will do, too: "ABS_HAT0Y-" is up on a hat, "ABS_RZ+" a trigger.
    What `pause`, `reset`, `save`, `prove`, `undo` and `experts` (who gets control) ask is not for every pad: they may
    be left out.
    `freeze` says that a live pad of this kind is never silent. `axes` and `buttons` are the order of `joy`.
    """

    name: str
    forward: Axis
    turn: Axis
    dead_man: str
    turbo: str
    estop: Annotated[tuple[str, ...], Meta(min_length=1)]
    release: str
    pause: str | None = None
    reset: str | None = None
    save: str | None = None
    prove: str | None = None
    undo: str | None = None
    experts: tuple[str, ...] = ()
    dead_zone: Annotated[float, Meta(ge=0.0, le=0.9)] = 0.12
    expo: Share = 0.4
    cruise: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.5
    freeze: bool = False
    axes: tuple[str, ...] = ()
    buttons: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the names: raises `ValueError`, which loading turns into a `ConfigError`."""
        asking = [name for name in self.asking if name]
        used = [self.dead_man, self.turbo, *self.estop, self.release, *asking, *self.experts]
        for name in (*used, *self.buttons):
            if not is_control(name):
                raise ValueError(f"there is no button named {name}")
        for name in (self.forward.axis, self.turn.axis, *self.axes):
            if name not in AXES:
                raise ValueError(f"there is no axis named {name}")
        if len(set(used)) < len(used):
            raise ValueError("dead_man, turbo, estop, release and what asks for something must be different buttons")
        if {axis_of(name) for name in used} & {self.forward.axis, self.turn.axis}:
            raise ValueError("an axis that drives cannot serve as a button")
        if self.forward.axis == self.turn.axis:
            raise ValueError("forward and turn must be different axes")

    @property
    def asking(self) -> tuple[str | None, ...]:
        """What asks something, but for the experts."""
        return self.pause, self.reset, self.save, self.prove, self.undo

    @property
    def needed_buttons(self) -> frozenset[int]:
        """Codes of the buttons without which this is no pad to drive with."""
        return frozenset(BUTTONS[name] for name in self._needed if name in BUTTONS)

    @property
    def needed_axes(self) -> frozenset[int]:
        """Codes of the axes without which this is no pad to drive with."""
        ends = [axis for name in self._needed if (axis := axis_of(name)) is not None]
        return frozenset(AXES[name] for name in (self.forward.axis, self.turn.axis, *ends))

    @property
    def _needed(self) -> tuple[str, ...]:
        return (self.dead_man, self.turbo, *self.estop, self.release)


def known_pads() -> list[str]:
    """Names of the mappings that come with the project."""
    folder = resources.files("lira.tools.joystick.pads")
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_mapping(name_or_path: str) -> Mapping:
    """Load a mapping by name or from a .toml file. Raises `ConfigError`."""
    if name_or_path.endswith(".toml"):
        return load_toml(Path(name_or_path), Mapping)
    if name_or_path not in known_pads():
        raise ConfigError(
            f"unknown pad '{name_or_path}'",
            f"Known: {', '.join(known_pads())}; or write a file of your own with: lira joystick --learn my-pad.toml",
        )
    with resources.as_file(resources.files("lira.tools.joystick.pads") / f"{name_or_path}.toml") as path:
        return load_toml(path, Mapping)
