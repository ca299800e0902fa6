"""Waiting for what must come, in tests that run in real time."""

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from functools import wraps
from threading import Thread
from time import monotonic
from typing import Any, TypeVar

import pytest

from weberlink.testing.time import PATIENCE, PAUSE, until

__all__ = ["PATIENCE", "PAUSE", "in_loop", "loop_in_a_thread", "soon", "until"]

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


@contextmanager
def loop_in_a_thread() -> Iterator[asyncio.AbstractEventLoop]:
    """As that of a daemon, beside the test; at the end what it serves is closed in this thread."""
    loop = asyncio.new_event_loop()
    thread = Thread(target=loop.run_forever)
    thread.start()
    try:
        yield loop
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
