"""Runs the monitor: web server, watcher of sessions, and the session that pages start."""

import asyncio
import logging
import os
import sys
import webbrowser
from collections.abc import Callable, Coroutine, Iterable, Iterator, Sized
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from signal import SIGHUP, SIGINT, SIGTERM, Signals
from socket import socket
from tempfile import NamedTemporaryFile
from time import monotonic
from typing import Any

import uvloop
from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from weberlink.telemetry.runtime_directory import directory
from weberlink_page import access, address
from weberlink_page.front import FrontOrder
from weberlink_page.launcher import SessionLauncher, SessionResult, TryOrder
from weberlink_page.listener import Listener
from weberlink_page.metrics import exposition
from weberlink_page.pictures import PictureService
from weberlink_page.recording import FOLDER, RecordingService
from weberlink_page.watch import SessionWatcher
from weberlink_page.web import Site

NICENESS = 5
STOP_LIMIT_S = 1.0  # time limit for closing the pages
FAREWELL_S = 0.1  # how long the pages may take to read the last figures
LOOK_S = 0.25  # period of looking whether a page is open


@dataclass(frozen=True)
class MonitorSettings:
    """What to serve, and where."""

    listen: str = "127.0.0.1"
    port: int = 0  # 0 for any free one
    session: str | None = None  # name of the session to follow; None for all
    browse: bool = False  # whether to open the page in a browser
    recordings: Path = FOLDER  # folder of the recordings that pages start


@dataclass(frozen=True)
class TrySession:
    """A session that pages start and drive, on top of a monitor."""

    order: TryOrder
    listening: socket  # of the page
    token: str  # who has it may drive and change
    left_s: float | None = None  # how long the page may be closed, once it was open, before it ends [s]; None for ever


def run(settings: MonitorSettings, attempt: TrySession | None = None) -> SessionResult | None:
    """Serve until interrupted or terminated, or until the session of `weberlink try` ends by itself; returns the result
    of its last session, if there was one. Raises MonitorError if the address cannot be used.
    """
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        return runner.run(_serve(settings, attempt))


async def _serve(settings: MonitorSettings, attempt: TrySession | None) -> SessionResult | None:
    over = asyncio.Event()
    say = tell if attempt is None else partial(tell, program="weberlink try")
    watch = SessionWatcher(None, settings.session, say)
    watch.requests.token = access.kept_token(directory()) if attempt is None else attempt.token
    if attempt is not None:
        announce = partial(watch.tell_all, "launcher")
        watch.launcher = SessionLauncher(attempt.order, say, announce, watch.control.inherit)
    launcher = watch.launcher
    _on_signals(over, launcher)
    allowed = access.names(settings.listen)
    site = Site(watch, allowed, exposition(watch.sessions.values))
    application = site.application()
    pictures = PictureService(watch)
    application.router.add_get("/view", pictures.serve)
    runner = web.AppRunner(application, access_log=None, handle_signals=False, shutdown_timeout=STOP_LIMIT_S)
    logging.getLogger("aiohttp.server").addFilter(_is_of_ours)
    await runner.setup()
    assert runner.server is not None
    async with AsyncExitStack() as stack:
        stack.callback(RecordingService(watch, settings.recordings, tell).close)
        stack.push_async_callback(runner.cleanup)
        stack.push_async_callback(pictures.close)
        listening = address.bind(settings.listen, settings.port) if attempt is None else attempt.listening
        url = address.url(listening, watch.requests.token)
        order = FrontOrder(None if allowed is None else sorted(allowed), watch.requests.token, watch.scope)
        stack.callback(Listener(listening, runner.server, site.unproven, order, watch.stopped, say).close)
        if attempt is None:  # what carries the motion of the operator does not stand back
            os.nice(NICENESS)  # the front has started before: it stops sessions at ordinary priority
            say(f"{url} (Ctrl-C ends it)")
        if settings.browse and not webbrowser.open(stack.enter_context(leading_to(url))):
            say(f"no browser found; open {url} yourself")
        watch.look(monotonic())
        if not watch.sessions and attempt is None:
            say("waiting for a daemon; start weberlink loopback")
        if attempt is not None and attempt.left_s is not None:
            leaving = end_when_left(watch.viewers, attempt.left_s, over, say)
            stack.callback(asyncio.get_running_loop().create_task(leaving).cancel)
        await _first([watch.run(), over.wait() if launcher is None else _until_over(launcher, over, watch)])
    return None if launcher is None else launcher.last


def _is_of_ours(record: logging.LogRecord) -> bool:
    """Whether what is logged is no fault of a client: strangers could fill the terminal with tracebacks."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, HttpProcessingError | ConnectionError)


async def _first(coroutines: Iterable[Coroutine[Any, Any, object]]) -> None:
    """Run coroutines until the first one ends; cancels the others. Raises its error."""
    tasks = [asyncio.ensure_future(each) for each in coroutines]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _until_over(launcher: SessionLauncher, over: asyncio.Event, watch: SessionWatcher) -> None:
    await launcher.run(over)
    watch.look(monotonic())  # so that the pages get the last figures
    await asyncio.sleep(FAREWELL_S)


@contextmanager
def leading_to(url: str) -> Iterator[str]:
    """Address of a file that leads a browser to a page; its arguments, which every user can read, have no key then."""
    with NamedTemporaryFile("w", suffix=".html", dir=directory()) as file:
        file.write(f'<meta http-equiv="refresh" content="0; url={url}">\n')
        file.flush()
        yield Path(file.name).as_uri()


async def end_when_left(
    pages: Sized, limit_s: float, over: asyncio.Event, say: Callable[[str], None], look_s: float = LOOK_S
) -> None:
    """Set `over` once no page has been open for a time [s] after one was, and say so."""
    open_at = inf
    while monotonic() - open_at < limit_s:
        await asyncio.sleep(look_s)
        if pages:
            open_at = monotonic()
    say(f"the page has been closed for {limit_s:g} s, so this ends")
    over.set()


def _on_signals(over: asyncio.Event, launcher: SessionLauncher | None) -> None:
    """End at a signal, and pass it on to the session that pages start."""

    def end(number: Signals) -> None:
        if launcher is not None:
            launcher.signal(number)
        over.set()

    for number in (SIGINT, SIGTERM, SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, end, number)


def tell(text: str, program: str = "weberlink monitor") -> None:
    """Print a line for the user."""
    sys.stderr.write(f"{program}: {text}\n")
    sys.stderr.flush()
