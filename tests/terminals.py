"""A terminal of 80 columns for a program, and what it shows on it."""

import os
import pty
import re
import termios
from contextlib import suppress

from tests.program import Program

WIDTH = 80


def on_terminal(*arguments: object) -> tuple[int, list[str]]:
    """Run a command on a terminal to its end; returns its exit status and the lines shown, without colours."""
    user, theirs = pty.openpty()
    try:
        termios.tcsetwinsize(theirs, (24, WIDTH))
        with Program(*arguments, terminal=theirs) as program:
            os.close(theirs)
            pieces = []
            with suppress(OSError):  # EIO is the end of a terminal
                while piece := os.read(user, 65_536):
                    pieces.append(piece)
            status = program.finish()[0]
    finally:
        for descriptor in (user, theirs):
            with suppress(OSError):
                os.close(descriptor)
    return status, re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", b"".join(pieces).decode()))
