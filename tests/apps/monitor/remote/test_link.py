"""Both ends of the telemetry link in this process, over loopback, on rings written by the test."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from tests.apps.monitor.feeds import BANK, RATE, description, records, write
from tests.strangers import Stranger, hold_connections, needs_root
from tests.system.processes import PATIENCE
from weberlink.apps.monitor.remote import following as following_module
from weberlink.apps.monitor.remote.following import Following
from weberlink.apps.monitor.remote.messages import (
    LinkMessage,
    RecordBlock,
    SideIntroduction,
    pack_introduction,
    pack_records,
)
from weberlink.apps.monitor.remote.sharing import MOST_CALLERS, MOST_UNPROVEN, Sharing
from weberlink.apps.monitor.remote.stream import MessageStream, accept, close, connect, telemetry_terms
from weberlink.apps.monitor.session import WatchedSession
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.system.description import path_beside
from weberlink.system.scoring.session import Records, SessionScore
from weberlink.telemetry.ring import RingWriter

KEY = bytes(range(32))
Tamper = Callable[[int, bytes], bytes]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody has to wait for the next call."""
    monkeypatch.setattr(following_module, "RETRY_S", 0.02)
    monkeypatch.setattr(following_module, "LONGEST_RETRY_S", 0.04)
    monkeypatch.setattr(following_module, "ARRANGE_S", 0.05)


def run(test: Awaitable[None]) -> None:
    async def limited() -> None:
        async with asyncio.timeout(PATIENCE):
            await test

    asyncio.run(limited())


async def until(condition: Callable[[], object]) -> None:
    while not condition():
        await asyncio.sleep(0.01)


class Host:
    """A host with rings, as a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.said: list[str] = []
        self.rings: list[RingWriter] = []
        folder.mkdir()

    def ring(self, session: int, side: str, capacity: int = 10_000) -> RingWriter:
        path = self.folder / f"weberlink-{session}-{side}.ring"
        self.rings.append(RingWriter.create(path, side=side, rate_hz=RATE, capacity=capacity))
        return self.rings[-1]

    @asynccontextmanager
    async def sharing(self, key: bytes = KEY, port: int = 0) -> AsyncIterator[int]:
        sharing = Sharing(telemetry_terms(key), self.folder, None, self.said.append)
        _, port = await sharing.open("127.0.0.1", port)
        try:
            yield port
        finally:
            await sharing.close()

    @asynccontextmanager
    async def looking(self, port: int, key: bytes = KEY) -> AsyncIterator[SessionWatcher]:
        watch = SessionWatcher(self.folder, None, lambda _: None)
        following = Following(telemetry_terms(key), ("127.0.0.1", port), watch, self.folder, self.said.append)
        tasks = [asyncio.ensure_future(task) for task in (watch.run(), following.run())]
        try:
            yield watch
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def close(self) -> None:
        for ring in self.rings:
            ring.close()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Host]:
    host = Host(tmp_path / "robot")
    yield host
    host.close()


@pytest.fixture
def operator(tmp_path: Path) -> Iterator[Host]:
    host = Host(tmp_path / "operator")
    yield host
    host.close()


def ticks(session: WatchedSession | None, side: str) -> int:
    return 0 if session is None else session.score.summary()["ticks"][side]["count"]


def test_shared_session_has_the_figures_of_its_rings(robot: Host, operator: Host) -> None:
    made = {"master": records(3000, seed=1), "slave": records(3000, phase=3e-4, seed=2)}

    async def test() -> None:
        rings = {side: robot.ring(7, side) for side in made}
        async with robot.sharing() as port, operator.looking(port) as watch:
            for part in range(10):
                for side, ring in rings.items():
                    write(ring, made[side][300 * part : 300 * part + 300])
                await asyncio.sleep(0.02)
            await until(lambda: all(ticks(watch.newest, side) == 3000 for side in made))
            session = watch.newest
            assert session is not None and session.remote and session.name == "remote"
            assert session.seen_from_start and not session.ended
            told = session.hello()
            assert told["readonly"] and told["remote"] and told["present"] == ["master", "slave"]
            robot.close()
            await until(lambda: session.ended)
            score = SessionScore(RATE, BANK)
            score.add(made["master"], made["slave"])
            force, expected = session.figures()["figures"]["force"], score.summary()["force"]
            for name in ("error_rms", "error_max", "violation_fraction"):
                assert force[name] == pytest.approx(expected[name], rel=1e-9)
            rings = {side: robot.ring(8, side) for side in made}
            await until(lambda: watch.newest is not session)
            assert watch.newest is not None and watch.newest.name == "remote-2"

    run(test())
    assert "127.0.0.1 connected" in robot.said


def test_changed_path_reaches_the_viewing_host(robot: Host, operator: Host) -> None:
    def describe(ring: RingWriter, **path: Any) -> None:
        """As a daemon does: the file is replaced at once."""
        beside = path_beside(ring.path)
        draft = beside.with_suffix(".draft")
        draft.write_text(
            json.dumps(description("slave") | {"paths": [PathFacts(remote="10.0.0.2:47000", **path)._asdict()]}),
            encoding="utf-8",
        )
        draft.replace(beside)

    async def test() -> None:
        ring = robot.ring(7, "slave")
        describe(ring)
        write(ring, records(100))
        async with robot.sharing() as port, operator.looking(port) as watch:
            await until(lambda: ticks(watch.newest, "slave") == 100)
            session = watch.newest
            assert session is not None and session.paths["slave"][0]["route"] == "direct"
            describe(ring, route="relayed", via="relay.example", changes=1)
            await until(lambda: session.paths["slave"][0]["route"] == "relayed")
            write(ring, records(1100, first=100))
            await until(lambda: ticks(session, "slave") == 1200)
            await until(lambda: session.log.events[-1].text == "path: relayed by relay.example, 1 change")
            assert watch.newest is session, "the same session goes on"

    run(test())


def test_wrong_key_is_one_line_and_sees_nothing(robot: Host, operator: Host) -> None:
    async def test() -> None:
        robot.ring(7, "slave")
        async with robot.sharing() as port, operator.looking(port, bytes(32)) as watch:
            await until(lambda: operator.said)
            await asyncio.sleep(0.3)  # some more calls
            assert watch.newest is None

    run(test())
    (said,) = operator.said
    assert "--key-file" in said and "\n" not in said
    assert robot.said == []


async def viewer(port: int) -> tuple[MessageStream, asyncio.StreamWriter]:
    """A caller who has proved the key."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    stream = await connect(reader, writer, telemetry_terms(KEY), PATIENCE)
    await stream.send(LinkMessage.READY, b"", PATIENCE)
    return stream, writer


def test_number_of_callers_is_limited(robot: Host) -> None:
    async def test() -> None:
        async with robot.sharing() as port:
            viewers = [await viewer(port) for _ in range(MOST_CALLERS)]
            await until(lambda: len(robot.said) == MOST_CALLERS)
            stream, writer = await viewer(port)
            with pytest.raises(OSError, match="closed"):
                await stream.receive(PATIENCE)
            for _, one in [*viewers, (stream, writer)]:
                one.close()

    run(test())


def test_silent_callers_lock_nobody_out(robot: Host) -> None:
    async def test() -> None:
        async with robot.sharing() as port:
            idle = [await asyncio.open_connection("127.0.0.1", port) for _ in range(MOST_UNPROVEN + 1)]
            _, writer = await viewer(port)
            await until(lambda: robot.said == ["127.0.0.1 connected"])
            for _, one in [*idle, (None, writer)]:
                one.close()

    run(test())


@needs_root
def test_idle_callers_of_another_user_lock_nobody_out(robot: Host) -> None:
    async def test() -> None:
        async with robot.sharing() as port:
            with await asyncio.to_thread(Stranger, hold_connections, "127.0.0.1", port, 100):
                _, writer = await viewer(port)
                await until(lambda: robot.said == ["127.0.0.1 connected"])
                writer.close()

    run(test())


def test_caller_has_limited_time_to_prove_the_key(robot: Host) -> None:
    async def test() -> None:
        sharing = Sharing(telemetry_terms(KEY), robot.folder, None, robot.said.append, handshake_s=0.2)
        _, port = await sharing.open("127.0.0.1", 0)
        for is_silent in (True, False):
            began = monotonic()
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            if not is_silent:  # proves the key, and then says nothing
                await connect(reader, writer, telemetry_terms(KEY), PATIENCE)
            await reader.read()
            assert 0.1 < monotonic() - began < 2.0
            writer.close()
        await sharing.close()

    run(test())
    assert robot.said == []


@asynccontextmanager
async def proxy(port: int, tamper: Tamper) -> AsyncIterator[int]:
    """A relay that may change what the sharing end sends."""
    tasks: list[asyncio.Task[None]] = []

    async def pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, change: Tamper) -> None:
        count = 0
        try:
            while data := await reader.read(65_536):
                count += 1
                writer.write(change(count, data))
                await writer.drain()
        except OSError:
            pass
        finally:
            writer.close()

    async def called(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there = await asyncio.open_connection("127.0.0.1", port)
        tasks.append(asyncio.ensure_future(pump(reader, there[1], lambda _, data: data)))
        tasks.append(asyncio.ensure_future(pump(there[0], writer, tamper)))

    server = await asyncio.start_server(called, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def test_tampered_stream_is_dropped_without_losing_records(robot: Host, operator: Host) -> None:
    is_bad = True

    def flip(_: int, data: bytes) -> bytes:
        """One bit of every larger piece: of records."""
        if not is_bad or len(data) < 2000:
            return data
        return data[:1500] + bytes((data[1500] ^ 4,)) + data[1501:]

    async def test() -> None:
        nonlocal is_bad
        ring = robot.ring(7, "slave")
        made = records(2000, seed=1)
        async with robot.sharing() as port, proxy(port, flip) as between, operator.looking(between) as watch:
            await until(lambda: watch.newest)
            write(ring, made)
            await until(lambda: any("changed on its way" in said for said in operator.said))
            is_bad = False
            await until(lambda: ticks(watch.newest, "slave") == 2000)
            assert watch.newest is not None and watch.newest.seen_from_start
            assert watch.newest.name == "remote"

    run(test())


def test_session_continues_after_a_reconnection(robot: Host, operator: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following_module, "INTRODUCE_S", 0.1)

    async def test() -> None:
        ring = robot.ring(7, "slave")
        made = records(1500, seed=1)
        async with AsyncExitStack() as stack:
            first = AsyncExitStack()
            port = await first.enter_async_context(robot.sharing())
            watch = await stack.enter_async_context(operator.looking(port))
            write(ring, made[:500])
            await until(lambda: ticks(watch.newest, "slave") == 500)
            session = watch.newest
            assert session is not None
            await first.aclose()
            write(ring, made[500:1000])
            await until(lambda: any("cannot be reached" in said for said in operator.said))
            async with robot.sharing(port=port):
                write(ring, made[1000:])
                await until(lambda: ticks(watch.newest, "slave") == 1500)
                assert watch.newest is session and session.seen_from_start and not session.ended
            ring.close()
            async with robot.sharing(port=port):  # it ended while nobody could say so
                await until(lambda: session.ended)

    run(test())


APART = 4321.0
"""How far the clock of the robot's host is ahead of the operator's [s]."""


def of_this_moment(made: Records) -> Records:
    """Records that begin when their ring does."""
    moved = made.copy()
    moved["at"] += monotonic() - 10.0
    return moved


def of_the_robot(made: Records, tick_0: float) -> Records:
    """The slave's records as its own clock dates them; it hears the master after a while."""
    shifted = made.copy()
    shifted["at"] += APART
    shifted["peer_at"] = made["at"] - tick_0
    shifted["peer_at"][:200] = np.nan
    return shifted


def test_sides_of_two_hosts_become_one_session(robot: Host, operator: Host) -> None:
    """The figures are those of the same records on one host."""
    ours, theirs = operator.ring(5, "master"), robot.ring(7, "slave")
    master = of_this_moment(records(3000, phase=3e-4, seed=1))
    tick_0 = float(master["at"][0])
    slave = master.copy()
    for name in ("raw", "output", "decoded", "position"):
        slave[name] = records(3000, seed=2)[name]
    slave["at"] -= 3e-4
    after = records(1000, first=3000)
    after["at"] += tick_0 - 10.0

    async def test() -> None:
        async with robot.sharing() as port, operator.looking(port) as watch:
            for part in range(6):
                write(ours, master[500 * part : 500 * part + 500])
                write(theirs, of_the_robot(slave, tick_0)[500 * part : 500 * part + 500])
                await asyncio.sleep(0.1)
            await until(lambda: watch.newest is not None and len(watch.newest.feeds) == 2)
            session = watch.newest
            assert session is not None and session.remote and session.hello()["readonly"]
            await until(lambda: ticks(session, "slave") == 3000 and ticks(session, "master") == 3000)
            score = SessionScore(RATE, BANK)
            score.add(master, slave)
            force, expected = session.figures()["figures"]["force"], score.summary()["force"]
            for name in ("error_rms", "error_max", "violation_fraction"):
                assert force[name] == pytest.approx(expected[name], rel=1e-9)
            ours.close()
            write(theirs, of_the_robot(after, tick_0)[200:])
            await until(lambda: session.ended)

    run(test())
    assert any("are one session" in said for said in operator.said)


def test_foreign_master_is_not_joined(robot: Host, operator: Host) -> None:
    """It began at another time than the one that the slave hears."""
    stranger = records(1000, first=60_000)
    slave = records(1000)

    async def test() -> None:
        write(operator.ring(5, "master"), stranger)
        write(robot.ring(7, "slave"), of_the_robot(slave, 10.0))
        async with robot.sharing() as port, operator.looking(port) as watch:
            await until(lambda: ticks(watch.newest, "slave") == 1000)
            await asyncio.sleep(0.3)  # some looks for a counterpart
            assert watch.newest is not None and list(watch.newest.feeds) == ["slave"]

    run(test())


BEGIN = SideIntroduction("7", "slave", RATE, 10.0, description("slave"))
RECORDS = RecordBlock("slave", 10, 0, records(10))


@pytest.mark.parametrize(
    ("sent", "complaint"),
    [
        ([(LinkMessage.RECORDS, pack_records(RECORDS))], "did not introduce"),
        ([(LinkMessage.BEGIN, b"nonsense")], "cannot be unpacked"),
        ([(LinkMessage.BEGIN, pack_introduction(BEGIN._replace(description={"system": 5})))], "description"),
        ([(LinkMessage.BEGIN, pack_introduction(BEGIN._replace(description={"bank": [[], {}]})))], "description"),
        ([(99, b"")], "unknown kind"),
        (
            [
                (LinkMessage.BEGIN, pack_introduction(BEGIN)),
                (LinkMessage.BEGIN, pack_introduction(BEGIN._replace(session="8", side="master"))),
                (LinkMessage.RECORDS, pack_records(RECORDS)),
            ],
            "did not introduce",
        ),
    ],
)
def test_invalid_messages_end_the_connection(sent: list[tuple[int, bytes]], complaint: str, operator: Host) -> None:
    async def called(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            stream = await accept(reader, writer, telemetry_terms(KEY), PATIENCE)
            assert stream is not None
            for kind, payload in sent:
                await stream.send(kind, payload, PATIENCE)
            await reader.read()
        await close(writer)

    async def test() -> None:
        server = await asyncio.start_server(called, "127.0.0.1", 0)
        async with operator.looking(server.sockets[0].getsockname()[1]):
            await until(lambda: any(complaint in said for said in operator.said))
        server.close()

    run(test())


@pytest.mark.parametrize(("kind", "payload"), [(LinkMessage.ALIVE, b"more"), (LinkMessage.BEGIN, b""), (77, b"change")])
def test_viewer_requests_end_the_connection(kind: int, payload: bytes, robot: Host) -> None:
    async def test() -> None:
        async with robot.sharing() as port:
            stream, writer = await viewer(port)
            await until(lambda: "127.0.0.1 connected" in robot.said)
            await stream.send(LinkMessage.ALIVE, b"", PATIENCE)
            await stream.send(kind, payload, PATIENCE)
            await until(lambda: "127.0.0.1 disconnected" in robot.said)
            await close(writer)

    run(test())
