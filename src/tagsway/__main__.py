"""`python -m tagsway`: the command without its script."""

from tagsway.cli import main

main()
