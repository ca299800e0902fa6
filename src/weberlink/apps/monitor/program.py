"""The monitor as a process: what it is told, what it prints, and how it ends."""

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from errno import EADDRINUSE, EADDRNOTAVAIL
from signal import SIGHUP, SIGINT, SIGTERM
from time import monotonic

import uvloop
from aiohttp import web

from weberlink.apps.monitor import guard
from weberlink.apps.monitor.metrics import exposition
from weberlink.apps.monitor.remote.following import Following
from weberlink.apps.monitor.remote.sharing import Sharing
from weberlink.apps.monitor.watch import Watch
from weberlink.apps.monitor.web import Site
from weberlink.protocol.psk import PresharedKey

NICENESS = 5
STOP_LIMIT_S = 1.0
"""For pages to be told that it is over."""


class MonitorError(RuntimeError):
    """It cannot serve; the message is one line that says what to do."""


@dataclass(frozen=True)
class Order:
    """What to serve.

    Args:
        listen: address of the page.
        port: of the page; 0 for any free one.
        session: name of the one session to follow; None for all.
        browse: whether to open the page in the user's browser.
        share: where to share the telemetry of this host; None not to.
        source: the host whose telemetry to show; None for this one alone.
        security: of `share` and `source`, as of `handshake.suite`; None where there is neither.
    """

    listen: str = "127.0.0.1"
    port: int = 8765
    session: str | None = None
    browse: bool = False
    share: tuple[str, int] | None = None
    source: tuple[str, int] | None = None
    security: PresharedKey | None = None


def run(order: Order) -> None:
    """Serve until interrupted or terminated.

    Raises:
        MonitorError: the address cannot be used.
    """
    os.nice(NICENESS)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(_serve(order))


async def _serve(order: Order) -> None:
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (SIGINT, SIGTERM, SIGHUP):
        loop.add_signal_handler(number, over.set)
    watch = Watch(None, order.session, tell)
    site = Site(watch, guard.names(order.listen), exposition(watch.sessions.values))
    runner = web.AppRunner(site.application(), access_log=None, handle_signals=False, shutdown_timeout=STOP_LIMIT_S)
    await runner.setup()
    try:
        url = await _bind(runner, order)
        tell(f"{url} (Ctrl-C ends it)")
        if order.browse:
            _browse(url)
        async with _shared(order):
            watch.look(monotonic())
            if not watch.sessions and order.source is None:
                tell("waiting for a daemon; start weberlink loopback")
            tasks = [loop.create_task(watch.run())]
            if order.source is not None:
                assert order.security is not None
                following = Following(order.security, order.source, watch, None, tell)
                tasks.append(loop.create_task(following.run()))
            await _until(tasks, over)
    finally:
        await runner.cleanup()


@asynccontextmanager
async def _shared(order: Order) -> AsyncIterator[None]:
    """Share the telemetry meanwhile, where that was asked for."""
    if order.share is None:
        yield
        return
    assert order.security is not None
    sharing = Sharing(order.security, None, order.session, tell)
    try:
        host, port = await sharing.open(*order.share)
    except OSError as error:
        where = ":".join(map(str, order.share))
        raise MonitorError(f"--share {where}: cannot be served ({error.strerror or error}); give another") from None
    tell(f"shares the telemetry of this host on {host}:{port} with those who hold the key")
    try:
        yield
    finally:
        await sharing.close()


async def _until(tasks: Iterable[asyncio.Task[None]], over: asyncio.Event) -> None:
    """Wait for the wish to end, or for a task that fails, whose error is raised; the others are cancelled."""
    waiting = asyncio.get_running_loop().create_task(over.wait())
    everything = {waiting, *tasks}
    try:
        done, _ = await asyncio.wait(everything, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in everything:
            task.cancel()
        await asyncio.gather(*everything, return_exceptions=True)


async def _bind(runner: web.AppRunner, order: Order) -> str:
    site = web.TCPSite(runner, order.listen, order.port)
    try:
        await site.start()
    except OSError as error:
        raise MonitorError(_complaint(error, order)) from None
    host, port = runner.addresses[0][:2]
    shown = "127.0.0.1" if host == "0.0.0.0" else "::1" if host == "::" else host  # noqa: S104 - what a browser can open
    return f"http://[{shown}]:{port}/" if ":" in shown else f"http://{shown}:{port}/"


def _complaint(error: OSError, order: Order) -> str:
    if error.errno == EADDRINUSE:
        return f"port {order.port} is in use, perhaps by another monitor; give another, such as --port {order.port + 1}"
    if error.errno == EADDRNOTAVAIL:
        return f"--listen {order.listen}: no address of this host; leave it out for this host only"
    return f"--listen {order.listen}, --port {order.port}: cannot be served ({error.strerror or error})"


def _browse(url: str) -> None:
    import webbrowser  # noqa: PLC0415 - for those who ask

    if not webbrowser.open(url):
        tell(f"no browser was found; open {url} in one")


def tell(text: str) -> None:
    """A line for the person at the terminal."""
    sys.stderr.write(f"weberlink monitor: {text}\n")
    sys.stderr.flush()
