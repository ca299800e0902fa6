"""`python -m weberlink.master FILE` is `weberlink master FILE`."""

import sys

from weberlink.cli import app

app(["master", *sys.argv[1:]], prog_name="weberlink")
