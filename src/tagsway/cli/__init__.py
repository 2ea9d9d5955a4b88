"""The command: options in, one call, words and an exit code out."""

import gc
import os
import sys


def main() -> None:
    """Run the command `identify` (or `tagsway`, the same program) and exit with its code."""
    # Small matrices only: threads of the linear algebra cost more than they give, beside a decoder's above all.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from tagsway.cli.app import run

        code = run(sys.argv[1:])
    except KeyboardInterrupt:  # while the command still loads: from then on `run` tells of it
        sys.exit("error: interrupted")
    gc.freeze()  # all of it ends with the process: looking through it for cycles takes a third of a second
    sys.exit(code)
