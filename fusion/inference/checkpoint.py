"""Networks on disk: a .safetensors file with the weights and, as text, where they come from. No pickle."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import msgspec
from msgspec import Meta
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from lira.fusion.inference.architecture import FUSION, KERNEL, Architecture, Weighted, Weights, check_shapes
from lira.fusion.inference.build import driving
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.preprocess import MODALITIES, Shape
from lira.hal.config import MALFORMED, open_regular, write_whole
from lira.hal.errors import StorageError
from lira.hal.messages import Action
from lira.hal.profile import MAX_FILTERS

MOST_BYTES = 2**28  # eighty times the largest network that any robot here needs
MOST_EXAMPLES = 4096
_OF_KERNELS = ("examples", "fallback", "halves", "asks", "sides")
_KEY = "lira"  # the one metadata entry, JSON
_Share = Annotated[float, Meta(ge=-1.01, le=1.01)]  # of a robot's top speed


@dataclass
class Checkpoint:
    """What a file of weights is.

    `features` are those that the network looks at, by name and in order, with their shapes; `filters` is the width of
    the trunks that see pictures, 0 without any. `cruise` is an expert's measured action (linear, angular) on an empty
    straight course; `provenance` the command that made it. `labels` and `training_steps` are what it took; None for a
    file that was written before they were counted. `examples` is how many a kernel drives by, and `fallback` whether
    it falls back on its experts, `halves` whether it asks them with half of their view free, `asks` whether it asks the
    first for what that one taught it, `sides` whether it takes its side; the file of a network does not speak of these.
    """

    kind: str
    features: dict[str, Shape]
    filters: Annotated[int, Meta(ge=0, le=MAX_FILTERS)]
    profile: str
    cruise: tuple[_Share, _Share] | None
    provenance: str
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)]
    labels: int | None = None
    training_steps: int | None = None
    examples: Annotated[int, Meta(ge=0, le=MOST_EXAMPLES)] = 0
    fallback: bool = False
    halves: bool = False
    asks: bool = False
    sides: bool = False

    @classmethod
    def of(cls, network: Weighted, profile: str, provenance: str, seed: int, cruise: Action | None = None) -> Self:
        """Describe a network that was trained for a robot with this profile."""
        what = network.architecture
        shapes = dict(what.shapes)
        of_kernel = {name: getattr(what, name) for name in _OF_KERNELS}
        return cls(what.kind, shapes, what.filters, profile, cruise, provenance, seed, **of_kernel)

    @property
    def architecture(self) -> Architecture:
        """What the network is. Raises `ValueError` for one that cannot be."""
        if len(self.features) > len(MODALITIES):
            raise ValueError(f"a network of {len(self.features)} features")
        of_kernel = {name: getattr(self, name) for name in _OF_KERNELS}
        return Architecture(self.kind, self.features, self.filters, **of_kernel)


def save_checkpoint(path: Path, network: Weighted, checkpoint: Checkpoint) -> None:
    """Write a checkpoint whole or not at all. Raises `StorageError`."""
    about = {name: value for name, value in asdict(checkpoint).items() if value or name not in _OF_KERNELS}
    write_whole(path, save(network.weights(), {_KEY: json.dumps(about)}), folder=True)


def load_checkpoint(path: Path) -> tuple[DrivingNet, Checkpoint]:
    """Read a checkpoint. Raises `StorageError` for a file that is missing, corrupt or of another kind.

    Its shapes are compared with what it says of itself before a network is built or a weight is read.
    """
    if not path.exists():
        remedy = "A novice is novice.safetensors in the folder of its run; 'lira train-expert' makes an expert."
        raise StorageError(f"there is no checkpoint {path}", remedy)
    remedy = "Restore the file, or make it anew with the command that made it."
    _check_size(path)
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            if _KEY not in metadata:
                raise StorageError(f"{path} is no checkpoint of this project", "Give a file that 'lira' has written.")
            about = msgspec.json.decode(metadata[_KEY], type=dict[str, Any])
            checkpoint = msgspec.convert(_named(about), Checkpoint)
            names = file.keys()
            found = {name: tuple(file.get_slice(name).get_shape()) for name in names}
            check_shapes(checkpoint.architecture.weights, found)
            weights: Weights = {name: file.get_tensor(name) for name in names}
        network = driving(checkpoint.architecture, weights)
    except (SafetensorError, OSError) as error:
        raise StorageError(f"{path} is not a whole .safetensors file: {error}", remedy) from error
    except MALFORMED as error:
        raise StorageError(f"{path} does not hold what it says it does: {error}", remedy) from error
    return network, checkpoint


def _check_size(path: Path) -> None:
    """Raise `StorageError` for what is no file, or larger than any checkpoint."""
    try:
        with open_regular(path) as file:
            size = file.seek(0, 2)
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error
    if size > MOST_BYTES:
        raise StorageError(f"{path} has more than {MOST_BYTES} bytes", "Give a file that 'lira' has written.")


def _named(about: dict[str, Any]) -> dict[str, Any]:
    """Say by name which features a file is about that was written when there were only two, by their sizes."""
    if "features" in about or not {"kind", "bins", "filters"} <= about.keys():
        return about
    px = about.get("px", 32)
    both = {"image": [px, px], "scan": [about["bins"]]}
    seen = {name: shape for name, shape in both.items() if about["kind"] in (MODALITIES[name].sensor, FUSION, KERNEL)}
    return {**about, "features": seen, "filters": about["filters"] if "image" in seen else 0}
