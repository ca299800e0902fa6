"""Who may drive or watch gets the pictures at a place of his own, nobody else; a key that is withdrawn ends them."""

import asyncio
from pathlib import Path
from time import monotonic

import pytest

from plugins.video.tests.test_jpeg import jpeg
from plugins.video.tests.test_live import free_port, write
from tests.wait import PATIENCE, soon
from weberlink.config import MASTER, SLAVE, Configuration, load
from weberlink.protocol.keys import Right, generate
from weberlink.telemetry.pictures import HEAD, Picture
from weberlink_video.carrier import Carrier
from weberlink_video.hub import Hub
from weberlink_video.process import places

pytestmark = pytest.mark.realtime


class Robot:
    """The robot's end, which serves an operator and two watchers, with the keys of a folder."""

    def __init__(self, folder: Path, *keys: str) -> None:
        self.folder, self.keys, self.port = folder, folder / "keys", free_port()
        self.keys.touch(0o600)
        self.keys.write_text("".join((folder / name).read_text() for name in keys))
        self.carriers = places(self._load(self.keys), SLAVE, Hub(folder / "robot"))

    def _load(self, key: Path) -> Configuration:
        file = write(key.with_suffix(".yaml"), key, port=self.port, pictures=self.port)
        return load(file, ["slave.cameras.watchers=2"], sides=())

    async def _give(self) -> None:
        while True:
            for carrier in self.carriers:
                carrier.put(Picture(monotonic(), "test", jpeg()))
            await asyncio.sleep(0.03)

    def run(self) -> list["asyncio.Task[object]"]:
        return [asyncio.create_task(each) for each in (self._give(), *(carrier.run() for carrier in self.carriers))]

    def called(self, name: str, place: int) -> tuple[Hub, "asyncio.Task[str]"]:
        """What a host sees at a place, and why it does not."""
        hub = Hub(self.folder / f"{name}.pictures")
        return hub, asyncio.create_task(Carrier(self._load(self.folder / name), MASTER, hub, place).run())


async def end(*tasks: "asyncio.Task[object]") -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize(("right", "place"), [(Right.DRIVE, 0), (Right.WATCH, 1), (Right.DRIVE, 2)])
def test_who_may_gets_the_pictures_until_the_key_is_withdrawn(tmp_path: Path, right: Right, place: int) -> None:
    generate(tmp_path / "desk", right, "desk")
    generate(tmp_path / "other")

    async def run() -> None:
        robot = Robot(tmp_path, "desk", "other")
        running = robot.run()
        hub, desk = robot.called("desk", place)
        await soon(lambda: hub.newest, "a picture")
        robot.keys.write_text((tmp_path / "other").read_text())
        assert "may not drive any more" in await asyncio.wait_for(desk, PATIENCE)
        await end(*running)

    asyncio.run(run())


@pytest.mark.parametrize(("right", "place"), [(Right.STOP, 0), (Right.STOP, 1), (Right.WATCH, 0)])
def test_who_may_not_is_refused_in_words(tmp_path: Path, right: Right, place: int) -> None:
    generate(tmp_path / "desk", right, "desk")

    async def run() -> None:
        robot = Robot(tmp_path, "desk")
        running = robot.run()
        hub, desk = robot.called("desk", place)
        assert f"is to {right}" in await asyncio.wait_for(desk, PATIENCE)
        assert not hub.newest
        await end(*running)

    asyncio.run(run())


def test_what_is_no_picture_of_a_camera_is_dropped(tmp_path: Path) -> None:
    """The robot's end has the key, and sends names that are no text, controls of a terminal, and moments beyond all."""
    generate(tmp_path / "desk", Right.DRIVE, "desk")

    async def run() -> None:
        robot = Robot(tmp_path, "desk")
        running = robot.run()
        hub, desk = robot.called("desk", 0)
        await soon(lambda: hub.newest, "a picture")
        texts = [(b"\xff" * 500, b""), (b"\x1b[2J", b""), (b"wild", b"\n"), (b"old", b""), (b"new", b"")]
        for number, (name, note) in enumerate(texts, 7):
            carrier, now = robot.carriers[0], monotonic()
            at_us = {b"old": -(1 << 62), b"new": 1 << 62}.get(name, round((now - carrier._epoch) * 1e6))
            message = HEAD.pack(0.0, len(name), len(note), len(jpeg())) + name + note + jpeg()
            carrier._sender.put(number, message, now, at_us)
            await asyncio.sleep(0.05)
        hub.newest.pop("test")
        await soon(lambda: "test" in hub.newest, "another picture")
        assert set(hub.newest) == {"test"} and not desk.done()
        await end(*running, desk)

    asyncio.run(run())


def test_watchers_take_nothing_from_the_operator_and_from_each_other(tmp_path: Path) -> None:
    names = ("desk", "wall", "hall", "late")
    for name in names:
        generate(tmp_path / name, Right.DRIVE if name == "desk" else Right.WATCH, name)

    async def run() -> None:
        robot = Robot(tmp_path, *names)
        running = robot.run()
        seen = [robot.called(name, place) for place, name in enumerate(names[:3])]
        for hub, _ in seen:
            await soon(lambda hub=hub: hub.newest, "a picture")
        _, late = robot.called("late", 1)
        assert "serves" in await asyncio.wait_for(late, PATIENCE), "a place is not taken over"
        for hub, _ in seen:
            hub.newest.clear()
            await soon(lambda hub=hub: hub.newest, "another picture")
        most = {carrier._sender.most_bit_s for carrier in robot.carriers}
        assert most == {2e7 / 3}, "together no more than one alone"
        await end(*running, *(task for _, task in seen))

    asyncio.run(run())


def test_a_stranger_gets_neither_pictures_nor_an_answer(tmp_path: Path) -> None:
    generate(tmp_path / "other")
    generate(tmp_path / "stranger")

    async def run() -> None:
        robot = Robot(tmp_path, "other")
        running = robot.run()
        calls = [robot.called("stranger", place) for place in range(3)]
        for carrier, (hub, _) in zip(robot.carriers, calls, strict=True):
            await soon(lambda told=carrier.endpoint.statistics: told.drops >= 3, "three calls")
            assert carrier.endpoint.statistics.sent == 0
            assert not hub.newest
        await end(*running, *(task for _, task in calls))

    asyncio.run(run())
