"""`python -m benchmarks`: `weberlink bench` from a clone of the repository."""

import sys

from weberlink.cli import app

app(["bench", *sys.argv[1:]], prog_name="python -m benchmarks")
