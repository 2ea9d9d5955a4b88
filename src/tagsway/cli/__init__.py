"""The command: options in, one call, words and an exit code out."""

import sys


def main() -> None:
    """Run the command `identify` (or `tagsway`, the same program) and exit with its code."""
    from tagsway.cli.app import run

    sys.exit(run(sys.argv[1:]))
