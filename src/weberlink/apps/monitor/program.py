"""Runs the monitor: web server, watcher of sessions, and the link to another host."""

import asyncio
import os
import sys
import webbrowser
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack
from dataclasses import dataclass
from errno import EADDRINUSE, EADDRNOTAVAIL
from pathlib import Path
from signal import SIGHUP, SIGINT, SIGTERM
from time import monotonic
from typing import TYPE_CHECKING, Any

import uvloop
from aiohttp import web

from weberlink.apps.monitor import access
from weberlink.apps.monitor.metrics import exposition
from weberlink.apps.monitor.recording import FOLDER, RecordingDesk
from weberlink.apps.monitor.remote.following import Following
from weberlink.apps.monitor.remote.sharing import Sharing
from weberlink.apps.monitor.view import View, ViewDesk
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.apps.monitor.web import Site
from weberlink.apps.tasks import first_result
from weberlink.protocol.sealed_stream import StreamTerms

if TYPE_CHECKING:
    from weberlink.apps.monitor.replay import ReplaySource

NICENESS = 5
STOP_LIMIT_S = 1.0
"""Time limit for closing the pages."""


class MonitorError(RuntimeError):
    """The monitor cannot serve; the message says what to do."""


@dataclass(frozen=True)
class MonitorSettings:
    """What to serve, and where."""

    listen: str = "127.0.0.1"
    port: int = 8765
    session: str | None = None
    """Name of the session to follow; None for all."""
    browse: bool = False
    """Whether to open the page in a browser."""
    share: tuple[str, int] | None = None
    """Host and port to share this host's telemetry on."""
    source: tuple[str, int] | None = None
    """Host and port that shares its telemetry."""
    terms: StreamTerms | None = None
    """Of `share` and `source`, see `remote.stream.telemetry_terms`."""
    recordings: Path = FOLDER
    """Folder of the recordings that pages start."""
    replay: "ReplaySource | None" = None
    """A recording to show in the place of running sessions."""
    view: View | None = None
    """A picture to show beside the scene."""


def run(settings: MonitorSettings) -> None:
    """Serve until interrupted or terminated.

    Raises:
        MonitorError: the address cannot be used.
    """
    os.nice(NICENESS)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(_serve(settings))


async def _serve(settings: MonitorSettings) -> None:
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (SIGINT, SIGTERM, SIGHUP):
        loop.add_signal_handler(number, over.set)
    only = settings.session if settings.replay is None else settings.replay.name
    watch = SessionWatcher(None, only, tell)
    site = Site(watch, access.names(settings.listen), exposition(watch.sessions.values))
    application = site.application()
    view = None if settings.view is None else ViewDesk(watch, settings.view, tell)
    if view is not None:
        application.router.add_get("/view", view.serve)
    runner = web.AppRunner(application, access_log=None, handle_signals=False, shutdown_timeout=STOP_LIMIT_S)
    await runner.setup()
    async with AsyncExitStack() as stack:
        stack.callback(RecordingDesk(watch, settings.recordings, tell).close)
        if settings.replay is not None:
            stack.push_async_callback(_replay(watch, settings.replay))
        stack.push_async_callback(runner.cleanup)
        if view is not None:
            stack.push_async_callback(view.close)
        url = await _bind(runner, settings)
        tell(f"{url} (Ctrl-C ends it)")
        if settings.browse and not webbrowser.open(url):
            tell(f"no browser found; open {url} yourself")
        if settings.share is not None:
            stack.push_async_callback((await _share(settings)).close)
        watch.look(monotonic())
        if not watch.sessions and settings.source is None:
            tell("waiting for a daemon; start weberlink loopback")
        running: list[Coroutine[Any, Any, Any]] = [watch.run(), over.wait()]
        if settings.source is not None:
            assert settings.terms is not None
            running.append(Following(settings.terms, settings.source, watch, None, tell).run())
        await first_result(running)


def _replay(watch: SessionWatcher, source: "ReplaySource") -> Callable[[], Awaitable[None]]:
    """Show a recording; returns what ends that."""
    from weberlink.apps.monitor.replay import Replay  # noqa: PLC0415 - reads with an optional library

    return Replay(watch, source).close


async def _share(settings: MonitorSettings) -> Sharing:
    """Start sharing the telemetry of this host."""
    assert settings.share is not None
    assert settings.terms is not None
    sharing = Sharing(settings.terms, None, settings.session, tell)
    try:
        host, port = await sharing.open(*settings.share)
    except OSError as error:
        where = ":".join(map(str, settings.share))
        raise MonitorError(
            f"--share {where}: cannot be served ({error.strerror or error}); choose another address or port"
        ) from None
    tell(f"sharing the telemetry of this host on {host}:{port} with holders of the key")
    return sharing


async def _bind(runner: web.AppRunner, settings: MonitorSettings) -> str:
    site = web.TCPSite(runner, settings.listen, settings.port)
    try:
        await site.start()
    except OSError as error:
        raise MonitorError(_complaint(error, settings)) from None
    host, port = runner.addresses[0][:2]
    shown = "127.0.0.1" if host == "0.0.0.0" else "::1" if host == "::" else host  # noqa: S104 - a browser cannot open it
    return f"http://[{shown}]:{port}/" if ":" in shown else f"http://{shown}:{port}/"


def _complaint(error: OSError, settings: MonitorSettings) -> str:
    if error.errno == EADDRINUSE:
        port = settings.port
        return f"port {port} is in use, perhaps by another monitor; give another, such as --port {port + 1}"
    if error.errno == EADDRNOTAVAIL:
        return f"--listen {settings.listen}: not an address of this host; omit it to serve this host only"
    return f"--listen {settings.listen}, --port {settings.port}: cannot be served ({error.strerror or error})"


def tell(text: str) -> None:
    """Print a line for the user."""
    sys.stderr.write(f"weberlink monitor: {text}\n")
    sys.stderr.flush()
