"""`python -m lira.tools` is the `lira` command."""

from lira.tools.cli import entry

if __name__ == "__main__":
    entry()
