"""The command: options in, one call, words and an exit code out."""

import os
import sys


def main() -> None:
    """Run the command `identify` (or `tagsway`, the same program) and exit with its code."""
    # Small matrices only: threads of the linear algebra cost more than they give, beside a decoder's above all.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tagsway.cli.app import run

    sys.exit(run(sys.argv[1:]))
