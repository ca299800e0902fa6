"""Child processes that run Python: they import nothing from the current folder, where anybody may put a `json.py`."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

SAFE_PATH: Final = "PYTHONSAFEPATH"


def python(*arguments: str) -> list[str]:
    """A command that runs this interpreter with these arguments; PYTHONPATH counts as ever."""
    return [sys.executable, "-P", *arguments]


@contextmanager
def safe_path() -> Iterator[None]:
    """Within this, processes that `multiprocessing` starts are as those of `python`."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before
