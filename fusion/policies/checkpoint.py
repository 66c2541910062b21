"""Networks on disk: a .safetensors file with the weights and, as text, where they come from. No pickle."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import torch
from msgspec import Meta
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from lira.fusion.policies.kernel_net import KernelNet
from lira.fusion.policies.networks import IMAGE_PX, CameraNet, FusionNet, Kind, LidarNet, Network, Weights
from lira.hal.config import MALFORMED, open_regular, write_whole
from lira.hal.errors import StorageError
from lira.hal.profile import MAX_BINS, MAX_FILTERS, MAX_IMAGE_PX

MOST_BYTES = 2**28  # eighty times the largest network that any robot here needs
LEAST_PX = 6  # two convolutions and a pooling leave one pixel of it

MOST_EXAMPLES = 4096
_KEY = "lira"  # the one metadata entry, JSON
_Share = Annotated[float, Meta(ge=-1.01, le=1.01)]  # of a robot's top speed


@dataclass
class Checkpoint:
    """What a file of weights is.

    `cruise` is an expert's measured action (linear, angular) on an empty straight course; `provenance` the command
    that made it. `bins`, `filters` and `px` are the sizes of the sensors' trunks, also for the one that is not used.
    `labels` and `training_steps` are what it took; None for a file that was written before they were counted.
    `examples` is how many a kernel drives by; a network drives by none, and its file does not speak of them.
    """

    kind: Kind
    bins: Annotated[int, Meta(ge=1, le=MAX_BINS)]
    filters: Annotated[int, Meta(ge=1, le=MAX_FILTERS)]
    profile: str
    cruise: tuple[_Share, _Share] | None
    provenance: str
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)]
    px: Annotated[int, Meta(ge=LEAST_PX, le=MAX_IMAGE_PX)] = IMAGE_PX
    labels: int | None = None
    training_steps: int | None = None
    examples: Annotated[int, Meta(ge=0, le=MOST_EXAMPLES)] = 0


def save_checkpoint(path: Path, network: Network, checkpoint: Checkpoint) -> None:
    """Write a checkpoint whole or not at all. Raises `StorageError`."""
    about = {name: value for name, value in asdict(checkpoint).items() if name != "examples" or value}
    write_whole(path, save(network.weights(), {_KEY: json.dumps(about)}), folder=True)


def load_checkpoint(path: Path) -> tuple[Network, Checkpoint]:
    """Read a checkpoint. Raises `StorageError` for a file that is missing, corrupt or of another kind.

    Its shapes are compared with what it says of itself before a network is built or a weight is read.
    """
    if not path.exists():
        raise StorageError(f"there is no checkpoint {path}", "Check the path, or make one with 'lira train-expert'.")
    remedy = "Restore the file, or make it anew with the command that made it."
    _check_size(path)
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            if _KEY not in metadata:
                raise StorageError(f"{path} is no checkpoint of this project", "Give a file that 'lira' has written.")
            checkpoint = msgspec.json.decode(metadata[_KEY], type=Checkpoint)
            names = file.keys()
            _check_shapes(checkpoint, {name: tuple(file.get_slice(name).get_shape()) for name in names})
            weights: Weights = {name: file.get_tensor(name) for name in names}
        network = build(checkpoint)
        network.load_weights(weights)
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


def _check_shapes(checkpoint: Checkpoint, found: dict[str, tuple[int, ...]]) -> None:
    """Compare shapes with those of the network described, of which nothing is allocated. Raises `ValueError`."""
    with torch.device("meta"):
        own = {name: tuple(tensor.shape) for name, tensor in build(checkpoint).state_dict().items()}
    if own.keys() != found.keys():
        raise ValueError(f"weights of another network: {', '.join(sorted(own.keys() ^ found.keys()))}")
    for name, shape in own.items():
        if found[name] != shape:
            raise ValueError(f"{name} is {found[name]} instead of {shape}")


def build(checkpoint: Checkpoint) -> Network:
    """Make the network a checkpoint describes, with fresh weights. Raises `ValueError` for too many examples."""
    if not 0 <= checkpoint.examples <= MOST_EXAMPLES:
        raise ValueError(f"a kernel of {checkpoint.examples} examples")
    if checkpoint.kind == "camera":
        return CameraNet(checkpoint.filters, px=checkpoint.px, seed=checkpoint.seed)
    if checkpoint.kind == "lidar":
        return LidarNet(checkpoint.bins, seed=checkpoint.seed)
    if checkpoint.kind == "kernel":
        return KernelNet(checkpoint.bins, checkpoint.filters, px=checkpoint.px, examples=checkpoint.examples)
    return FusionNet(checkpoint.bins, checkpoint.filters, px=checkpoint.px, seed=checkpoint.seed)
