"""Say what a recording holds: of which robot, how long, which topics and how often, what was lost, who drove.

Lost is what was sent and never came to the recorder, by the numbers that senders give; "-" where those do not tell.
What is latched is sent once, and told to all who ever come.

examples:
  lira info runs/demo-20261127-101500
  lira info recordings/20261127-120000/20261127-120000_0.mcap
  lira info runs/mine --json -

exit status: 0, 1 if the recorder lost something or a file was cut off, 2 if there is no recording
"""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lira.hal.words import plural
from lira.tools.options import add_json

if TYPE_CHECKING:
    from lira.tools.recording.summary import Summary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("file", type=Path, metavar="FILE", help="an .mcap file, the folder of a recording, or of a run")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Read it all and say what there is."""
    from lira.tools.output.machine import output_for, tell
    from lira.tools.recording.reader import Recording
    from lira.tools.recording.summary import summarise

    output = output_for(args.json)
    summary = summarise(Recording(args.file))
    tell(args.json, output, plain(summary), words(summary))
    return 1 if summary.torn or summary.lost else 0


def words(summary: "Summary") -> str:
    """The summary to read."""
    from lira.tools.output.table import format_table

    began = datetime.fromtimestamp(summary.began_ns / 1e9, UTC).astimezone()
    where = f"world '{summary.world}'" if summary.world else "a floor"
    many = f"{len(summary.files)} files" if len(summary.files) > 1 else f"{summary.files[0]}"
    size = f"{plural(summary.count, 'message')}, {summary.bytes / 1e6:.1f} MB"
    lines = [
        f"robot '{summary.robot}' ({summary.profile}) in {where}, {summary.mode}, recorded {began:%Y-%m-%d %H:%M:%S}",
        f"{summary.duration_s:.1f} s of the robot's time, {size}, {many}",
        "",
        format_table(
            ("topic", "type", "count", "rate", "gap", "size", "lost"),
            [
                (
                    topic.key,
                    topic.ros_type,
                    str(topic.count),
                    *(("once", "") if topic.count == 1 else (f"{topic.rate_hz:.1f} Hz", f"{topic.gap_s:.2f} s")),
                    f"{topic.bytes / 1e3:.0f} kB",
                    "-" if topic.missing is None else str(topic.missing or "none"),
                )
                for topic in summary.topics.values()
            ],
        ),
        "",
    ]
    if summary.drivers:
        total = summary.drivers.total()
        shares = ", ".join(f"{driver} {count / total:.0%}" for driver, count in summary.drivers.most_common())
        calls = ", ".join(f"{count} {call}" for call, count in summary.calls.most_common())
        lines.append(f"{plural(total, 'decision')}: {shares}; calls: {calls or 'none'}")
    if summary.lost:
        lost = ", ".join(f"{count} of {key}" for key, count in summary.lost.items())
        lines.append(f"the recorder lost: {lost}")
    lines += [f"{path} was cut off: lira record --recover {path} gives it an index" for path in summary.torn]
    return "\n".join(lines).rstrip()


def plain(summary: "Summary") -> dict[str, Any]:
    """The summary as JSON has it."""
    return {
        "robot": summary.robot,
        "profile": summary.profile,
        "world": summary.world,
        "mode": summary.mode,
        "began_s": summary.began_ns / 1e9,
        "duration_s": summary.duration_s,
        "version": summary.version,
        "command": summary.command,
        "files": [str(path) for path in summary.files],
        "torn": [str(path) for path in summary.torn],
        "bytes": summary.bytes,
        "messages": summary.count,
        "lost": summary.lost,
        "drivers": dict(summary.drivers),
        "calls": dict(summary.calls),
        "topics": {
            topic.key: {
                "type": topic.ros_type,
                "count": topic.count,
                "rate_hz": topic.rate_hz,
                "gap_s": topic.gap_s,
                "bytes": topic.bytes,
                "missing": topic.missing,
            }
            for topic in summary.topics.values()
        },
    }
