"""Tables for the terminal."""

from collections.abc import Sequence


def format_table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Align rows under their names: the first column to the left, the others to the right.

    Names of several words are stacked, so that narrow columns stay narrow.
    """
    stacked = [name.split() for name in names]
    height = max(map(len, stacked), default=0)
    header = [[""] * (height - len(words)) + words for words in stacked]
    lines = [[words[line] for words in header] for line in range(height)]
    widths = [max(len(row[column]) for row in [*lines, *rows]) for column in range(len(names))]

    def line(cells: Sequence[str]) -> str:
        first, *others = (cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
        return "  ".join([cells[0].ljust(len(first)), *others]).rstrip()

    return "\n".join(line(cells) for cells in [*lines, *rows])
