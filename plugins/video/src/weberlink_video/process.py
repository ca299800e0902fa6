"""The process beside a daemon that makes the pictures of a robot, or receives them.

`python -m weberlink_video.process ORDER`, with a `PicturesOrder` in JSON. It has neither the rights nor the memory of
the daemon.
"""

import asyncio
import os
import sys
from contextlib import suppress
from pathlib import Path
from signal import SIGTERM
from threading import Thread
from time import monotonic

import uvloop

from weberlink.config import SLAVE, Configuration, ConfigurationError, load
from weberlink.config.cameras import PicturesOrder, path_beside
from weberlink.realtime.process import die_with_parent, forbid_core_dumps
from weberlink.session import description
from weberlink.text import one_line
from weberlink_figures.pictures import Picture
from weberlink_video.carrier import Carrier
from weberlink_video.hub import Hub
from weberlink_video.sources import Camera, Robot

NICENESS = 5


async def run(order: PicturesOrder, configuration: Configuration) -> None:
    """Make or receive pictures until this process is told to end."""
    hub = Hub(path_beside(order.ring))
    carriers = places(configuration, order.side, hub) if order.is_alone else []
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(SIGTERM, ended.set)
    await hub.open()
    cameras = _start_cameras(order, configuration, hub, carriers) if order.side == SLAVE else []
    carrying = [loop.create_task(_carry(carrier, hub)) for carrier in carriers]
    await ended.wait()
    for camera in cameras:
        camera.end()
    for carrier in carriers:
        carrier.end()
    if carrying:
        await asyncio.wait(carrying, timeout=0.5)
    hub.close()


def places(configuration: Configuration, side: str, hub: Hub) -> list[Carrier]:
    """The ends of this side: of the robot's one for each host that it serves."""
    assert configuration.cameras is not None
    carriers: list[Carrier] = []
    count = 1 + configuration.cameras.options.watchers if side == SLAVE else 1  # type: ignore[attr-defined]
    carriers += (Carrier(configuration, side, hub, place, carriers) for place in range(count))
    return carriers


async def _carry(carrier: Carrier, hub: Hub) -> None:
    """Carry pictures; say in the place of a picture why there are none."""
    try:
        why = await carrier.run()
    except OSError as error:
        why = error.strerror or str(error)
    if why:
        hub.put(Picture(monotonic(), "", b"", one_line(f"no pictures: {why}")))
        sys.stderr.write(f"weberlink pictures: {one_line(why)}\n")


def _start_cameras(
    order: PicturesOrder, configuration: Configuration, hub: Hub, carriers: list[Carrier]
) -> list[Camera]:
    assert configuration.cameras is not None
    loop = asyncio.get_running_loop()

    def give(picture: Picture) -> None:
        hub.put(picture)
        for carrier in carriers:
            carrier.put(picture)

    def give_later(picture: Picture) -> None:
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(give, picture)

    def robot() -> Robot:
        pid = (description.read(order.ring) or {}).get("pid")
        model = configuration.system.slave.robot.options.get("model")
        is_model = isinstance(model, str) and model.endswith(".xml")
        return Robot(pid, configuration.path.parent / model if is_model and model else None)

    cameras = [Camera(source, robot, give_later) for source in configuration.cameras.options.sources]  # type: ignore[attr-defined]
    for camera in cameras:
        Thread(target=camera.run, daemon=True).start()
    return cameras


def main(text: str) -> int:
    """Run an order; returns the exit status."""
    order = PicturesOrder.from_json(text)
    die_with_parent(SIGTERM, order.parent)
    forbid_core_dumps()
    os.nice(NICENESS)
    try:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(run(order, load(Path(order.file), order.overrides, sides=())))
    except (ConfigurationError, OSError) as error:
        sys.stderr.write(f"weberlink pictures: {one_line(str(error))}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
