"""Who may drive or watch gets the pictures at a place of his own, nobody else; a key that is withdrawn ends them."""

import asyncio
from pathlib import Path
from time import monotonic
from typing import Any, Self

import pytest

from plugins.video.tests.test_jpeg import jpeg
from plugins.video.tests.test_live import free_port, write
from tests.wait import PATIENCE, in_loop, soon
from weberlink.config import MASTER, SLAVE, Configuration, load
from weberlink.protocol.keys import Right, generate
from weberlink_figures.pictures import HEAD, Picture
from weberlink_video.carrier import Carrier
from weberlink_video.hub import Hub
from weberlink_video.process import places

pytestmark = pytest.mark.realtime


class Robot:
    """The robot's end, which serves an operator and two watchers, with keys of these names and rights, all at work."""

    def __init__(self, folder: Path, **rights: Right) -> None:
        self.folder, self.keys, self.port = folder, folder / "keys", free_port()
        for name, right in rights.items():
            generate(folder / name, right, name)
        self.keys.touch(0o600)
        self.keys.write_text("".join((folder / name).read_text() for name in rights))
        self.carriers = places(self._load(self.keys), SLAVE, Hub(folder / "robot"))
        self._tasks: list[asyncio.Task[Any]] = []

    async def __aenter__(self) -> Self:
        self._tasks += [asyncio.create_task(each) for each in (self._give(), *(each.run() for each in self.carriers))]
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _load(self, key: Path) -> Configuration:
        file = write(key.with_suffix(".yaml"), key, port=self.port, pictures=self.port)
        return load(file, ["slave.cameras.watchers=2"], sides=())

    async def _give(self) -> None:
        while True:
            for carrier in self.carriers:
                carrier.put(Picture(monotonic(), "test", jpeg()))
            await asyncio.sleep(0.03)

    def called(self, name: str, place: int) -> tuple[Hub, "asyncio.Task[str]"]:
        """What a host sees at a place, and why it does not."""
        hub = Hub(self.folder / f"{name}.pictures")
        self._tasks.append(
            task := asyncio.create_task(Carrier(self._load(self.folder / name), MASTER, hub, place).run())
        )
        return hub, task


@pytest.mark.parametrize(("right", "place"), [(Right.DRIVE, 0), (Right.WATCH, 1), (Right.DRIVE, 2)])
@in_loop
async def test_who_may_gets_the_pictures_until_the_key_is_withdrawn(tmp_path: Path, right: Right, place: int) -> None:
    async with Robot(tmp_path, desk=right, other=Right.DRIVE) as robot:
        hub, desk = robot.called("desk", place)
        await soon(lambda: hub.newest, "a picture")
        robot.keys.write_text((tmp_path / "other").read_text())
        assert "may not drive any more" in await asyncio.wait_for(desk, PATIENCE)


@pytest.mark.parametrize(("right", "place"), [(Right.STOP, 0), (Right.STOP, 1), (Right.WATCH, 0)])
@in_loop
async def test_who_may_not_is_refused_in_words(tmp_path: Path, right: Right, place: int) -> None:
    async with Robot(tmp_path, desk=right) as robot:
        hub, desk = robot.called("desk", place)
        assert f"is to {right}" in await asyncio.wait_for(desk, PATIENCE)
        assert not hub.newest


@in_loop
async def test_what_is_no_picture_of_a_camera_is_dropped(tmp_path: Path) -> None:
    """The robot's end has the key, and sends names that are no text, controls of a terminal, and moments beyond all."""
    async with Robot(tmp_path, desk=Right.DRIVE) as robot:
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


@in_loop
async def test_watchers_take_nothing_from_the_operator_and_from_each_other(tmp_path: Path) -> None:
    names = dict.fromkeys(("desk", "wall", "hall", "late"), Right.WATCH) | {"desk": Right.DRIVE}
    async with Robot(tmp_path, **names) as robot:
        seen = [robot.called(name, place)[0] for place, name in enumerate(("desk", "wall", "hall"))]
        for hub in seen:
            await soon(lambda hub=hub: hub.newest, "a picture")
        _, late = robot.called("late", 1)
        assert "serves" in await asyncio.wait_for(late, PATIENCE), "a place is not taken over"
        for hub in seen:
            hub.newest.clear()
            await soon(lambda hub=hub: hub.newest, "another picture")
        most = {carrier._sender.most_bit_s for carrier in robot.carriers}
        assert most == {2e7 / 3}, "together no more than one alone"


@in_loop
async def test_a_stranger_gets_neither_pictures_nor_an_answer(tmp_path: Path) -> None:
    generate(tmp_path / "stranger")
    async with Robot(tmp_path, other=Right.DRIVE) as robot:
        calls = [robot.called("stranger", place) for place in range(3)]
        for carrier, (hub, _) in zip(robot.carriers, calls, strict=True):
            await soon(lambda told=carrier.endpoint.statistics: told.drops >= 3, "three calls")
            assert carrier.endpoint.statistics.sent == 0
            assert not hub.newest
