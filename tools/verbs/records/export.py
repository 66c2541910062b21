"""Write a recorded run as a data set of others: each decision with what was sensed, who drove, and what all proposed.

lerobot: a LeRobotDataset v3.0 (parquet, MP4, JSON). robomimic: one HDF5 file. csv: a line a step, without pictures.
Laps are episodes, whole, whoever drove: `intervention` and `source` say who, `in_buffer` what the learner kept. The log
of labels is found beside the recording; without one the recording's counts tell what was kept.

onnx: no data set, but a novice or an expert (a .safetensors file) for whatever runs ONNX; it takes the extra onnx.

examples:
  lira export lerobot runs/mine datasets/mine
  lira export robomimic runs/mine mine.hdf5
  lira export csv recordings/20261127-120000 mine.csv
  lira export onnx runs/mine/novice.safetensors novice.onnx
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lira.hal.words import plural

if TYPE_CHECKING:
    from lira.tools.export.run import RecordedRun

DATA_SETS = ("lerobot", "robomimic", "csv")
FORMATS = (*DATA_SETS, "onnx")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("format", choices=FORMATS)
    add(
        "file",
        type=Path,
        metavar="FILE",
        help="an .mcap file, the folder of a recording, or of a run; of onnx: a novice, or the folder of its run",
    )
    add(
        "out",
        type=Path,
        metavar="OUT",
        help="what to write: a folder for lerobot, else a file; nothing is written over",
    )
    add("--labels", type=Path, metavar="FILE", help="log of the run's labels (default: labels.lira beside it)")
    add("--task", metavar="WORDS", help="what was taught, in words (default: drive in <world>)")


def run(args: argparse.Namespace) -> int:
    """Read the run, or the novice, and write it."""
    from lira.tools.output.places import check_new

    check_new(args.out, folders=args.format == "lerobot")
    if args.format == "onnx":
        return write_network(args)
    from lira.tools.export.run import load_run

    found = load_run(args.file, args.labels)
    write(args, found)
    count = sum(map(len, found.tables))
    kept = sum(int(table["in_buffer"].values.sum()) for table in found.tables)
    by = f"by {found.labels}" if found.labels else "by the recording's counts"
    all_of_it = f"{plural(len(found.tables), 'episode')}, {plural(count, 'step')}"
    print(f"written: {args.out}: {all_of_it}; labels learned: {kept}, {by}")
    return 0


def write_network(args: argparse.Namespace) -> int:
    """Read a novice or an expert, and write it."""
    from lira.fusion.inference.checkpoint import load_checkpoint
    from lira.tools.export.onnx_file import write_onnx
    from lira.tools.runs.names import NOVICE, in_run

    network, checkpoint = load_checkpoint(in_run(args.file, NOVICE))
    write_onnx(network, checkpoint, args.out)
    kind = {"fusion": "a novice", "kernel": "a kernel novice"}.get(checkpoint.kind, f"a {checkpoint.kind} expert")
    print(f"written: {args.out}: {kind} of '{checkpoint.profile}' that sees {' and '.join(checkpoint.features)}")
    return 0


def write(args: argparse.Namespace, found: "RecordedRun") -> None:
    """Write the format that was asked for."""
    robot, world = found.head.info.profile.name, found.head.world
    if args.format == "csv":
        from lira.tools.export.csv_file import write_csv

        write_csv(found.tables, args.out)
    elif args.format == "robomimic":
        from lira.tools.export.robomimic import write_robomimic

        write_robomimic(found.tables, found.cameras, args.out, {"robot": robot, "world": world})
    else:
        from lira.tools.export.lerobot import write_lerobot

        task = args.task or (f"drive in {world}" if world else "drive")
        write_lerobot(found.tables, found.cameras, args.out, robot=robot, task=task, fps=found.fps)
