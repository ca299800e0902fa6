"""`python -m weberlink` is `weberlink`."""

from weberlink.cli import main

main()
