"""Takes a free place of a robot's pictures, and shows them to the pages of this host."""

import asyncio
import os
from signal import SIGINT, SIGTERM

from weberlink.cli.output import tell
from weberlink.config import Configuration
from weberlink.config.cameras import path_beside
from weberlink.order import MASTER
from weberlink.session.description import Description, describe
from weberlink.telemetry.ring import RingWriter, default_path
from weberlink_video.carrier import Carrier
from weberlink_video.hub import Hub

TAKE_OVER = "; to take it over, use --take-over"  # last words of the refusal of an end that serves somebody else
LOOK_S = 0.1


async def watch_pictures(configuration: Configuration, duration: float | None) -> str | None:
    """Take the first free place, until it is over; why there is none, or None at the end.

    What this host has of the session is its description, so that a page finds it, and the pictures: no record.
    """
    assert configuration.cameras is not None
    ring, loop, over = default_path(f"{os.getpid()}-{MASTER}"), asyncio.get_running_loop(), asyncio.Event()
    for number in (SIGINT, SIGTERM):
        loop.add_signal_handler(number, over.set)
    if duration is not None:
        loop.call_later(duration, over.set)
    described = describe(configuration, MASTER) | {"changes": []}
    described["system"]["master"].pop("device")  # nothing of this host drives
    description, hub = Description(ring, described), Hub(path_beside(ring))
    description.publish()
    why, place = "slave.cameras.watchers is 0 in this file: nobody may watch", 0
    telling = loop.create_task(_tell_of_the_first(hub))
    try:
        with RingWriter(ring, side=MASTER, rate_hz=described["rate_hz"], capacity=2):
            await hub.open()
            ending = loop.create_task(over.wait())
            for place in range(1, 1 + configuration.cameras.options.watchers):  # type: ignore[attr-defined]
                carrier = Carrier(configuration, MASTER, hub, place)
                carrying = loop.create_task(carrier.run())
                await asyncio.wait([carrying, ending], return_when=asyncio.FIRST_COMPLETED)
                carrier.end()
                why = await carrying
                if over.is_set():
                    return None
        refused = why.removesuffix(TAKE_OVER)  # which would not be for this
        return why if refused == why else f"{refused}; slave.cameras.watchers: {place} of both files allows no more"
    finally:
        telling.cancel()
        hub.close()
        description.remove()


async def _tell_of_the_first(hub: Hub) -> None:
    while not hub.newest:
        await asyncio.sleep(LOOK_S)
    tell("weberlink monitor shows the pictures (Ctrl-C ends it)")
