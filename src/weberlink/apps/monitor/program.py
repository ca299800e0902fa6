"""Runs the monitor: web server, watcher of sessions, and the session that pages start."""

import asyncio
import os
import sys
import webbrowser
from collections.abc import Callable, Iterator, Sized
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from signal import SIGHUP, SIGINT, SIGTERM, Signals
from socket import socket
from tempfile import NamedTemporaryFile
from time import monotonic

import uvloop
from aiohttp import web

from weberlink.apps.monitor import access, address
from weberlink.apps.monitor.keeper import SessionKeeper, SessionResult, VisitOrder
from weberlink.apps.monitor.metrics import exposition
from weberlink.apps.monitor.recording import FOLDER, RecordingDesk
from weberlink.apps.monitor.view import View, ViewDesk
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.apps.monitor.web import Site
from weberlink.apps.tasks import first_result
from weberlink.telemetry.runtime_directory import directory

NICENESS = 5
STOP_LIMIT_S = 1.0
"""Time limit for closing the pages."""
FAREWELL_S = 0.1
"""How long the pages may take to read the last figures of a visit."""
LOOK_S = 0.25
"""Period of looking whether a page is open."""


@dataclass(frozen=True)
class MonitorSettings:
    """What to serve, and where."""

    listen: str = "127.0.0.1"
    port: int = 0
    """0 for any free one."""
    session: str | None = None
    """Name of the session to follow; None for all."""
    browse: bool = False
    """Whether to open the page in a browser."""
    recordings: Path = FOLDER
    """Folder of the recordings that pages start."""
    view: View | None = None
    """A picture to show beside the scene."""


@dataclass(frozen=True)
class Visit:
    """A session that pages start and drive, on top of a monitor."""

    order: VisitOrder
    listening: socket
    """Of the page."""
    token: str
    """Who has it may drive and change."""
    left_s: float | None = None
    """How long the page may be closed, once it was open, before the visit ends [s]; None for ever."""


def run(settings: MonitorSettings, visit: Visit | None = None) -> SessionResult | None:
    """Serve until interrupted or terminated, or until the visit ends by itself.

    Returns:
        Of the last session of the visit, if there was one.

    Raises:
        MonitorError: the address cannot be used.
    """
    if visit is None:  # one that carries the motion of the operator, and their emergency stop, does not stand back
        os.nice(NICENESS)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        return runner.run(_serve(settings, visit))


async def _serve(settings: MonitorSettings, visit: Visit | None) -> SessionResult | None:
    over = asyncio.Event()
    say = tell if visit is None else partial(tell, program="weberlink try")
    watch = SessionWatcher(None, settings.session, say)
    watch.requests.token = access.kept_token(directory()) if visit is None else visit.token
    keeper = None if visit is None else _keeper(visit, watch, say)
    _on_signals(over, keeper)
    site = Site(watch, access.names(settings.listen), exposition(watch.sessions.values))
    application = site.application()
    view = None if settings.view is None else ViewDesk(watch, settings.view, tell)
    if view is not None:
        application.router.add_get("/view", view.serve)
    runner = web.AppRunner(application, access_log=None, handle_signals=False, shutdown_timeout=STOP_LIMIT_S)
    await runner.setup()
    async with AsyncExitStack() as stack:
        stack.callback(RecordingDesk(watch, settings.recordings, tell).close)
        stack.push_async_callback(runner.cleanup)
        if view is not None:
            stack.push_async_callback(view.close)
        listening = address.bind(settings.listen, settings.port) if visit is None else visit.listening
        await web.SockSite(runner, listening).start()
        url = address.url(listening, watch.requests.token)
        if visit is None:
            say(f"{url} (Ctrl-C ends it)")
        if settings.browse and not webbrowser.open(stack.enter_context(leading_to(url))):
            say(f"no browser found; open {url} yourself")
        watch.look(monotonic())
        if not watch.sessions and visit is None:
            say("waiting for a daemon; start weberlink loopback")
        if visit is not None and visit.left_s is not None:
            leaving = end_when_left(watch.viewers, visit.left_s, over, say)
            stack.callback(asyncio.get_running_loop().create_task(leaving).cancel)
        ended = over.wait() if keeper is None else _visited(keeper, over, watch)
        await first_result([watch.run(), ended])
    return None if keeper is None else keeper.last


@contextmanager
def leading_to(url: str) -> Iterator[str]:
    """Address of a file that leads a browser to a page; its arguments, which every user can read, have no key then."""
    with NamedTemporaryFile("w", suffix=".html", dir=directory()) as file:
        file.write(f'<meta http-equiv="refresh" content="0; url={url}">\n')
        file.flush()
        yield Path(file.name).as_uri()


def _keeper(visit: Visit, watch: SessionWatcher, say: Callable[[str], None]) -> SessionKeeper:
    """The keeper of a visit, which its pages may use."""
    announce = partial(watch.tell_all, "keeper")
    watch.keeper = SessionKeeper(visit.order, say, announce, watch.control.inherit)
    return watch.keeper


async def _visited(keeper: SessionKeeper, over: asyncio.Event, watch: SessionWatcher) -> None:
    await keeper.run(over)
    watch.look(monotonic())  # so that the pages get the last figures
    await asyncio.sleep(FAREWELL_S)


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


def _on_signals(over: asyncio.Event, keeper: SessionKeeper | None) -> None:
    """End at a signal, and pass it on to the session of a visit."""

    def end(number: Signals) -> None:
        if keeper is not None:
            keeper.signal(number)
        over.set()

    for number in (SIGINT, SIGTERM, SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, end, number)


def tell(text: str, program: str = "weberlink monitor") -> None:
    """Print a line for the user."""
    sys.stderr.write(f"{program}: {text}\n")
    sys.stderr.flush()
