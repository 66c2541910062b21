"""From an observation to what the networks see: named arrays, one for each modality that the robot's profile chooses.

A modality is a row of `MODALITIES`. To learn from one more sensor takes a function in `modalities/` that turns its
message into an array, a row here, and its name among the `inputs` of a profile.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lira.fusion.modalities.depth import near_depth
from lira.fusion.modalities.image import check_light, from_uint8, gray_image, to_uint8
from lira.fusion.modalities.reading import ReadingError
from lira.fusion.modalities.scan import bin_scan
from lira.hal.errors import ConfigError
from lira.hal.messages import CompressedImage, DepthImage, FloatArray, Image, LaserScan, Observation
from lira.hal.profile import MAX_BINS, MAX_IMAGE_PX, RobotProfile

Shape = tuple[int, ...]
Look = Callable[[str], Any]
"""Measures a sensor now, by its field of an observation; what comes is never stale."""
LEAST_PX = 6  # two convolutions and a pooling leave one pixel of it


class Features(Mapping[str, FloatArray]):
    """What the networks see: arrays by name, float32 in [0, 1], as many as the robot's profile chooses.

    `scan` [bins] and `image` [px, px] unless it says otherwise, and `depth` [px, px] where it does. `seen.scan` and
    `seen["scan"]` are the same. The last axis runs across what is seen, so that reversing it exchanges left and right.
    """

    __slots__ = ("_arrays",)
    _arrays: dict[str, FloatArray]

    def __init__(self, **arrays: FloatArray) -> None:
        self._arrays = arrays

    def __getitem__(self, name: str) -> FloatArray:
        return self._arrays[name]

    def __getattr__(self, name: str) -> FloatArray:
        if name.startswith("_") or name not in self._arrays:
            raise AttributeError(f"these features have no '{name}', but {' and '.join(self) or 'nothing'}")
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Features, **self._arrays), ()

    def __repr__(self) -> str:
        return f"Features({', '.join(f'{name}={array.shape}' for name, array in self.items())})"

    __eq__ = object.__eq__  # arrays have no one answer to it
    __hash__ = object.__hash__

    def mirrored(self) -> "Features":
        """Exchange left and right."""
        return Features(**{name: np.ascontiguousarray(array[..., ::-1]) for name, array in self.items()})


class FeaturesSeen(Features):
    """Features that are made when somebody asks for them: who looks at one sensor does not pay for another."""

    __slots__ = ("_make",)

    def __init__(self, make: Mapping[str, Callable[[], FloatArray]]) -> None:
        super().__init__()
        self._make = make

    def __getitem__(self, name: str) -> FloatArray:
        if name not in self._arrays:
            self._arrays[name] = self._make[name]()
        return self._arrays[name]

    def __getattr__(self, name: str) -> FloatArray:
        if not name.startswith("_") and name in self._make:
            return self[name]
        return super().__getattr__(name)

    def __contains__(self, name: object) -> bool:
        return name in self._make

    def __iter__(self) -> Iterator[str]:
        return iter(self._make)

    def __len__(self) -> int:
        return len(self._make)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Features, **dict(self)), ()


@dataclass(frozen=True, slots=True)
class Modality:
    """One row. `name` is that of the feature and of the observation's field it is made from.

    `sensor` is what measures it, and the name of the expert that sees nothing else. `read` makes the array of a reading
    and counts what is invalid in it. `trunk` is what part of a network looks at it. `free` is what it reads where
    nothing is, None where no value says so. A picture is kept in 8 bits, which loses nothing: its values are multiples
    of 1/255.
    """

    name: str
    sensor: str
    trunk: Literal["scan", "picture"]
    has: Callable[[RobotProfile], bool]
    read: Callable[[Any, RobotProfile], tuple[FloatArray, int]]
    free: float | None = None

    @property
    def dtype(self) -> type[np.float32] | type[np.uint8]:
        """What its values are kept as."""
        return np.float32 if self.trunk == "scan" else np.uint8

    def shape(self, profile: RobotProfile) -> Shape:
        """Shape of its array."""
        shape = profile.features
        return (shape.bins,) if self.trunk == "scan" else (shape.image_px, shape.image_px)

    def check(self, shape: Shape) -> None:
        """Raises `ValueError` for a shape that no robot of ours could have."""
        if self.trunk == "scan":
            fits = len(shape) == 1 and 1 <= shape[0] <= MAX_BINS
        else:
            fits = len(shape) == 2 and shape[0] == shape[1] and LEAST_PX <= shape[0] <= MAX_IMAGE_PX
        if not fits:
            raise ValueError(f"a {self.name} of shape {list(shape)}")

    def halves(self, array: FloatArray) -> tuple[FloatArray, ...]:
        """The array twice, its first and its last half free; () where nothing is in it, or no value says so."""
        if self.free is None or float(array.min()) >= self.free:
            return ()
        first, last = array.copy(), array.copy()
        half = array.shape[-1] // 2
        first[..., :half] = last[..., array.shape[-1] - half :] = self.free
        return first, last

    def keep(self, array: FloatArray) -> NDArray[Any]:
        """Turn an array into what is kept of it."""
        return array if self.trunk == "scan" else to_uint8(array)

    def restore(self, kept: NDArray[Any]) -> FloatArray:
        """Inverse of `keep`, exactly, in memory of its own."""
        return kept.astype(np.float32) if self.trunk == "scan" else from_uint8(kept)


def _scan(scan: LaserScan, profile: RobotProfile) -> tuple[FloatArray, int]:
    return bin_scan(scan, profile.features)


def _image(image: Image | CompressedImage, profile: RobotProfile) -> tuple[FloatArray, int]:
    gray = gray_image(image, profile.features.image_px)
    check_light(gray)
    return gray, 0


def _depth(depth: DepthImage | CompressedImage, profile: RobotProfile) -> tuple[FloatArray, int]:
    shape = profile.features
    return near_depth(depth, shape.image_px, shape.max_depth_m or shape.max_range_m), 0


# In the order in which networks see them and experts are asked.
MODALITIES = {
    row.name: row
    for row in (
        Modality("image", "camera", "picture", lambda _: True, _image),
        Modality("scan", "lidar", "scan", lambda _: True, _scan, free=1.0),
        Modality("depth", "depth", "picture", lambda profile: profile.depth is not None, _depth, free=1.0),
    )
}


def modalities_of(profile: RobotProfile) -> tuple[Modality, ...]:
    """The rows that a robot learns from. Raises `ConfigError` for one that is none, or that it has no sensor for."""
    chosen = profile.features.inputs
    for name in chosen:
        if name not in MODALITIES:
            what = f"features.inputs of '{profile.name}' names '{name}'"
            raise ConfigError(what, f"Known: {', '.join(MODALITIES)}.")
        if not MODALITIES[name].has(profile):
            what = f"'{profile.name}' is to learn from {name}, and has no sensor for it"
            raise ConfigError(what, f"Give its profile a [{name}] table, or leave it out of features.inputs.")
    return tuple(row for row in MODALITIES.values() if row.name in chosen)


def shapes_of(profile: RobotProfile) -> dict[str, Shape]:
    """Shapes of a robot's features by name. Raises `ConfigError` as `modalities_of` does."""
    return {row.name: row.shape(profile) for row in modalities_of(profile)}


class Preprocessor:
    """Turns observations into features and counts what it had to leave out.

    `invalid_beams` counts beams that read nan, `refused` the readings that could not be used, by reason.
    Raises `ConfigError` for a profile with inputs that its robot does not have.
    """

    def __init__(self, profile: RobotProfile) -> None:
        self._profile = profile
        self._modalities = modalities_of(profile)
        self.invalid_beams = 0
        self.refused: Counter[str] = Counter()

    def __call__(self, observation: Observation) -> Features | None:
        """Return the features, or None while a sensor is absent or stale. Raises `SensorError` after counting it."""
        if self.silent(observation):
            return None
        arrays: dict[str, FloatArray] = {}
        for row in self._modalities:
            try:
                arrays[row.name], invalid = row.read(getattr(observation, row.name), self._profile)
            except ReadingError as error:
                self.refused[error.reason] += 1
                raise
            self.invalid_beams += invalid
        return Features(**arrays)

    def looking(self, look: Look) -> Features:
        """Return features that are measured when somebody asks for them: of use until time goes on."""
        return FeaturesSeen({row.name: partial(self._make, row, look) for row in self._modalities})

    def _make(self, row: Modality, look: Look) -> FloatArray:
        array, _ = row.read(look(row.name), self._profile)
        return array

    def silent(self, observation: Observation) -> list[str]:
        """The sensors from which there is nothing."""
        return [row.sensor for row in self._modalities if getattr(observation, row.name) is None]
