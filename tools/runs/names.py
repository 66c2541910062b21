"""Names of what a learning run leaves in its folder. Without PyTorch: who reads a run may not have it."""

from pathlib import Path

LABELS, RECORD, NOVICE = "labels.lira", "run.jsonl", "novice.safetensors"


def in_run(path: Path | str, name: str) -> Path:
    """A file: the path itself, or what has this name in it, if it is the folder of a run."""
    there = Path(path)
    return there / name if there.is_dir() else there
