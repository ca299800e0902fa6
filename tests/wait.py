"""Waiting for what must come, in tests that run in real time."""

import asyncio
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

import pytest

from weberlink.testing.time import PATIENCE, PAUSE, until

__all__ = ["PATIENCE", "PAUSE", "soon", "until"]

T = TypeVar("T")


async def soon(condition: Callable[[], T], what: str, *, patience: float = PATIENCE, pause: float = PAUSE) -> T:
    """As `until`, while an event loop goes on."""
    deadline = monotonic() + patience
    while not (value := condition()):
        if monotonic() > deadline:
            pytest.fail(f"waited {patience:g} s for {what}")
        await asyncio.sleep(pause)
    return value
