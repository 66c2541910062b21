"""Networks on disk: a .safetensors file with the weights and, as text, where they come from. No pickle."""

import json
import os
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from fusion.kernel_net import KernelNet
from fusion.networks import IMAGE_PX, CameraNet, FusionNet, Kind, LidarNet, Network
from hal.errors import StorageError

MOST_EXAMPLES = 4096
_KEY = "lira"  # the one metadata entry, JSON


@dataclass
class Checkpoint:
    """What a file of weights is.

    `cruise` is an expert's measured action (linear, angular) on an empty straight course; `provenance` the command
    that made it. `bins`, `filters` and `px` are the sizes of the sensors' trunks, also for the one that is not used.
    `labels` and `training_steps` are what it took; None for a file that was written before they were counted.
    `examples` is how many a kernel drives by; a network drives by none, and its file does not speak of them.
    """

    kind: Kind
    bins: int
    filters: int
    profile: str
    cruise: tuple[float, float] | None
    provenance: str
    seed: int
    px: int = IMAGE_PX
    labels: int | None = None
    training_steps: int | None = None
    examples: int = 0


def save_checkpoint(path: Path, network: Network, checkpoint: Checkpoint) -> None:
    """Write a checkpoint whole or not at all. Raises `StorageError`."""
    about = {name: value for name, value in asdict(checkpoint).items() if name != "examples" or value}
    metadata = {_KEY: json.dumps(about)}
    data = save(network.weights(), metadata)
    draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with draft.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except OSError as error:
        with suppress(OSError):
            draft.unlink()
        what = f"cannot write {path}: {error.strerror}"
        raise StorageError(what, "Free some space or choose another folder.") from error


def load_checkpoint(path: Path) -> tuple[Network, Checkpoint]:
    """Read a checkpoint. Raises `StorageError` for a file that is missing, corrupt or of another kind."""
    if not path.is_file():
        raise StorageError(f"there is no checkpoint {path}", "Check the path, or make one with 'lira train-expert'.")
    remedy = "Restore the file, or make it anew with the command that made it."
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no dict
    except (SafetensorError, OSError, ValueError) as error:
        raise StorageError(f"{path} is not a whole .safetensors file: {error}", remedy) from error
    if _KEY not in metadata:
        raise StorageError(f"{path} is no checkpoint of this project", "Give a file that 'lira' has written.")
    try:
        checkpoint = msgspec.json.decode(metadata[_KEY], type=Checkpoint)
        network = build(checkpoint)
        network.load_weights(weights)
    except (msgspec.MsgspecError, ValueError) as error:
        raise StorageError(f"{path} does not hold what it says it does: {error}", remedy) from error
    return network, checkpoint


def build(checkpoint: Checkpoint) -> Network:
    """Make the network a checkpoint describes, with fresh weights."""
    if (
        not 0
        < min(checkpoint.bins, checkpoint.filters, checkpoint.px)
        <= max(checkpoint.bins, checkpoint.filters)
        < 4096
    ):
        raise ValueError(f"a network of {checkpoint.bins} bins and {checkpoint.filters} filters")
    if not 0 <= checkpoint.examples <= MOST_EXAMPLES:
        raise ValueError(f"a kernel of {checkpoint.examples} examples")
    if checkpoint.kind == "camera":
        return CameraNet(checkpoint.filters, px=checkpoint.px, seed=checkpoint.seed)
    if checkpoint.kind == "lidar":
        return LidarNet(checkpoint.bins, seed=checkpoint.seed)
    if checkpoint.kind == "kernel":
        return KernelNet(checkpoint.bins, checkpoint.filters, px=checkpoint.px, examples=checkpoint.examples)
    return FusionNet(checkpoint.bins, checkpoint.filters, px=checkpoint.px, seed=checkpoint.seed)
