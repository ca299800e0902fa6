"""The command line: arguments, exit statuses and what is printed.

Exit status: 0 done, 1 the run failed, 2 the file or the arguments are wrong (one line on standard error).
"""

from weberlink.cli.program import app, main

__all__ = ["app", "main"]
