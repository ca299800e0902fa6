"""Waiting for what must come, in tests that run in real time."""

import asyncio
from collections.abc import Callable
from time import monotonic, sleep
from typing import TypeVar

import pytest

T = TypeVar("T")

PATIENCE = 60.0
"""Until a test gives up on what must come [s]; says nothing about how fast the program has to be."""
PAUSE = 0.01


def until(condition: Callable[[], T], what: str, *, patience: float = PATIENCE, pause: float = PAUSE) -> T:
    """The first value of the condition that counts as true."""
    deadline = monotonic() + patience
    while not (value := condition()):
        if monotonic() > deadline:
            pytest.fail(f"waited {patience:g} s for {what}")
        sleep(pause)
    return value


async def soon(condition: Callable[[], T], what: str, *, patience: float = PATIENCE, pause: float = PAUSE) -> T:
    """The same while an event loop goes on."""
    deadline = monotonic() + patience
    while not (value := condition()):
        if monotonic() > deadline:
            pytest.fail(f"waited {patience:g} s for {what}")
        await asyncio.sleep(pause)
    return value
