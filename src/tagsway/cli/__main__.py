"""`python -m tagsway.cli`: the command without its script."""

from tagsway.cli import main

main()
