"""The command line: arguments, exit statuses and what is printed.

Exit status: 0 done, 1 the run failed, 2 the file or the arguments are wrong, 130 Ctrl-C or SIGTERM ended the work early
(one line on standard error each).
"""

import signal

_handler = signal.getsignal(signal.SIGINT)
if _handler is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C during the imports ends the process without a traceback
try:
    from weberlink.cli.program import app, main
finally:
    if _handler is signal.default_int_handler:
        signal.signal(signal.SIGINT, _handler)

__all__ = ["app", "main"]
