"""Asks the robot's end of a file over the link, without a device or a session: how it is, or to stop."""

import asyncio
from collections.abc import Mapping
from time import monotonic

import uvloop

from weberlink.cli.output import CommandError
from weberlink.config import MASTER, Configuration
from weberlink.config.finders import finder_of, finding
from weberlink.protocol import Endpoint, Event, Refused, Right, Told
from weberlink.protocol.aio.udp import UdpShell
from weberlink.session.composition.link import build_endpoint, live_context
from weberlink.session.daemon import emulated_link
from weberlink.text import one_line

PATIENCE_S, PATH_S = 5.0, 40.0  # for the answer, and in all where a path is to be found first
LOOK_S = 0.002


def ask(configuration: Configuration, asks: Right, patience_s: float = PATIENCE_S) -> Mapping[str, object]:
    """What the robot's end answers; to a stop, when it has stopped. Raises CommandError if it refuses or does not
    answer; ConfigurationError if the key cannot be read, or the peer is not known."""
    finder = finder_of(configuration, MASTER)
    epoch = monotonic()
    context = live_context(configuration, MASTER, finder, epoch, asks=asks)
    endpoint = build_endpoint(configuration.system, MASTER, context)
    emulated = emulated_link(MASTER, configuration.system, epoch)
    failures: list[str] = []
    # A path is wanted beside that of the master that is served.
    with finding(configuration, finder, take_over=True) as paths:
        shell = UdpShell(
            endpoint,
            now=monotonic,
            link=None if emulated is None else emulated.link,
            dscp=configuration.system.link.dscp,
            paths=paths,
            on_no_path=failures.append,
        )
        limit = PATH_S if configuration.finds_path else patience_s
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            answer = runner.run(_answer(endpoint, shell, limit, failures))
    match answer:
        case Told(body):
            return body
        case Refused(message):
            failures.append(f"refused: {one_line(message)}")
    why = failures[0] if failures else f"the robot's end did not answer in {limit:g} s"
    raise CommandError(f"{why}; it may not have stopped: stop it by hand" if asks is Right.STOP else why)


async def _answer(endpoint: Endpoint, shell: UdpShell, limit: float, failures: list[str]) -> Event | None:
    await shell.open(asyncio.get_running_loop())
    try:
        endpoint.connect(monotonic())
        until = monotonic() + limit
        while not failures and monotonic() < until:
            shell.service()
            shell.flush(monotonic())
            while (event := endpoint.next_event()) is not None:
                if isinstance(event, Told | Refused):
                    return event
            await asyncio.sleep(LOOK_S)
        return None
    finally:
        shell.close()
