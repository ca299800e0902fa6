"""Who holds a watching key gets the pictures, nobody else; a key that is withdrawn ends them."""

import asyncio
from pathlib import Path
from time import monotonic

import pytest

from plugins.video.tests.test_jpeg import jpeg
from plugins.video.tests.test_live import free_port, write
from tests.wait import soon
from weberlink.config import MASTER, SLAVE, load
from weberlink.protocol.keys import Right, generate
from weberlink.telemetry.pictures import Picture
from weberlink_video.carrier import Carrier
from weberlink_video.hub import Hub

pytestmark = pytest.mark.realtime


class Ends:
    """Both ends of the link of the pictures, the robot's with the keys of a folder, the desk's with one."""

    def __init__(self, folder: Path, key: str) -> None:
        keys = [(folder / name).read_text() for name in ("desk", "other") if (folder / name).exists()]
        self.keys = folder / "keys"
        self.keys.touch(0o600)
        self.keys.write_text("".join(keys))
        port = free_port()
        self.hubs = {side: Hub(folder / side) for side in (SLAVE, MASTER)}
        files = {SLAVE: self.keys, MASTER: folder / key}
        self.ends = {}
        for side, held in files.items():
            file = write(folder / f"{side}.yaml", held, port=port, pictures=port)
            self.ends[side] = Carrier(load(file, sides=()), side, self.hubs[side])

    async def give(self) -> None:
        """Pictures of the robot, for as long as this runs."""
        while True:
            self.ends[SLAVE].put(Picture(monotonic(), "test", jpeg()))
            await asyncio.sleep(0.03)

    async def run(self) -> tuple["asyncio.Task[str]", list["asyncio.Task[object]"]]:
        desk = asyncio.create_task(self.ends[MASTER].run())
        return desk, [asyncio.create_task(self.ends[SLAVE].run()), asyncio.create_task(self.give())]


def seen(ends: Ends) -> int:
    return len(ends.hubs[MASTER].newest)


async def end(*tasks: "asyncio.Task[object]") -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize("right", [Right.WATCH, Right.DRIVE])
def test_a_key_that_may_watch_gets_the_pictures_until_it_is_withdrawn(tmp_path: Path, right: Right) -> None:
    generate(tmp_path / "desk", right, "desk")
    generate(tmp_path / "other")

    async def run() -> None:
        ends = Ends(tmp_path, "desk")
        desk, others = await ends.run()
        await soon(lambda: seen(ends), "a picture")
        ends.keys.write_text((tmp_path / "other").read_text())
        assert "may not drive any more" in await asyncio.wait_for(desk, 5.0)
        await end(*others)

    asyncio.run(run())


def test_a_key_that_may_stop_is_refused_in_words(tmp_path: Path) -> None:
    generate(tmp_path / "desk", Right.STOP, "desk")
    generate(tmp_path / "other")

    async def run() -> None:
        ends = Ends(tmp_path, "desk")
        desk, others = await ends.run()
        assert "is to stop" in await asyncio.wait_for(desk, 5.0)
        assert not seen(ends)
        await end(*others)

    asyncio.run(run())


def test_a_stranger_gets_neither_pictures_nor_an_answer(tmp_path: Path) -> None:
    generate(tmp_path / "other")
    generate(tmp_path / "stranger")

    async def run() -> None:
        ends = Ends(tmp_path, "stranger")
        desk, others = await ends.run()
        await asyncio.sleep(1.5)
        robot = ends.ends[SLAVE].endpoint.statistics
        assert robot.drops >= 3
        assert robot.sent == 0
        assert not seen(ends)
        await end(desk, *others)

    asyncio.run(run())
