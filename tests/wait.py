"""Waiting for what must come, in tests that run in real time."""

import asyncio
from collections.abc import Callable, Coroutine
from functools import wraps
from time import monotonic
from typing import Any, TypeVar

import pytest

from weberlink.testing.time import PATIENCE, PAUSE, until

__all__ = ["PATIENCE", "PAUSE", "in_loop", "soon", "until"]

T = TypeVar("T")


def in_loop(
    test: Callable[..., Coroutine[Any, Any, None]], loop_factory: Callable[[], asyncio.AbstractEventLoop] | None = None
) -> Callable[..., None]:
    """The test in an event loop of its own, with a limit."""

    @wraps(test)
    def run(**fixtures: Any) -> None:
        async def limited() -> None:
            async with asyncio.timeout(3 * PATIENCE):
                await test(**fixtures)

        with asyncio.Runner(loop_factory=loop_factory) as runner:
            runner.run(limited())

    return run


async def soon(condition: Callable[[], T], what: str, *, patience: float = PATIENCE, pause: float = PAUSE) -> T:
    """As `until`, while an event loop goes on."""
    deadline = monotonic() + patience
    while not (value := condition()):
        if monotonic() > deadline:
            pytest.fail(f"waited {patience:g} s for {what}")
        await asyncio.sleep(pause)
    return value
