"""`python -m tools` is the `lira` command."""

from tools.cli import entry

if __name__ == "__main__":
    entry()
