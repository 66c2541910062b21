"""Writes what the documents take from the code, between two marks in each: `make generated`, and a test compares.

python docs/generate.py            say which documents are behind, exit 1 if any is
python docs/generate.py --write    bring them up to date
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from rooms import code_map
from ros2_tables import frame_table, heard_table, said_table, service_table
from topics import hash_table, topic_table

ROOT = Path(__file__).parent.parent
GENERATED: dict[tuple[str, str], Callable[[], str]] = {
    ("README.md", "map"): code_map,
    ("docs/bus.md", "topics"): topic_table,
    ("docs/bus.md", "hashes"): hash_table,
    ("docs/ros2-interface.md", "said"): said_table,
    ("docs/ros2-interface.md", "heard"): heard_table,
    ("docs/ros2-interface.md", "services"): service_table,
    ("docs/ros2-interface.md", "frames"): frame_table,
}


def renewed(text: str, mark: str, part: str) -> str:
    """Return a document with `part` between the marks of this name. Raises `ValueError` without them."""
    begin, end = f"<!-- {mark} -->\n", f"<!-- /{mark} -->\n"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"no marks called '{mark}'")
    return f"{before}{begin}{part}{end}{after}"


def behind(*, write: bool = False) -> list[str]:
    """Return the documents that say something else than the code does; with `write`, mend them."""
    found = []
    for (name, mark), make in GENERATED.items():
        path = ROOT / name
        text = path.read_text(encoding="utf-8")
        if (new := renewed(text, mark, make())) != text:
            found.append(f"{name} ({mark})")
            if write:
                path.write_text(new, encoding="utf-8")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    stale = behind(write=args.write)
    print("\n".join(f"{'written' if args.write else 'behind the code'}: {each}" for each in stale) or "up to date")
    sys.exit(bool(stale) and not args.write)
