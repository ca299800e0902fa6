"""Work for processes and clusters that is not evaluation. Imports little: what does the work imports this module."""

import os
import signal
from time import sleep
from typing import Any

Timed = tuple[tuple[float, str], int]
"""How long to take [s], something for all, and a number."""


def slowly(task: Timed) -> tuple[int, int]:
    """Which process did it, and what was asked."""
    (seconds, _), number = task
    sleep(seconds)
    return os.getpid(), number


def reject(task: Any) -> Any:
    """Ends its process as the kernel does when memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)
