"""`python -m weberlink.slave FILE` is `weberlink slave FILE`."""

import sys

from weberlink.cli import main

main(["slave", *sys.argv[1:]])
