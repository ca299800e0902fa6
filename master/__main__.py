"""`python -m weberlink.master FILE` is `weberlink master FILE`."""

import sys

from weberlink.cli import main

main(["master", *sys.argv[1:]])
