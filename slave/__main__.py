"""`python -m weberlink.slave FILE` is `weberlink slave FILE`."""

import sys

from weberlink.cli import app

app(["slave", *sys.argv[1:]], prog_name="weberlink")
