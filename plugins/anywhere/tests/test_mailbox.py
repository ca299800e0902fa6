"""A mailbox server that says what it likes: a host tells one line, and lives on."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from select import select

import pytest
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from plugins.anywhere.tests.meetings import PATIENCE, Pair
from tests.wait import in_loop
from weberlink.config.finders import running
from weberlink_anywhere import hand_over
from weberlink_anywhere.hand_over import PathNews
from weberlink_anywhere.mailbox import MOST_STORED, MailboxRefuses, open_mailbox
from weberlink_anywhere.order import FinderOrder
from weberlink_anywhere.peers import PeerStore
from weberlink_anywhere.sealing import Sealing
from weberlink_anywhere.signalling import MailboxUnreachable

LONG = "\x1b[2J\n" + "x" * 5000
LONGEST = 500  # characters of a line that a person is told
WELCOME = json.dumps({"type": "welcome", "welcome": {}})
WORDS = {
    "error": (WELCOME, json.dumps({"type": "error", "error": LONG})),
    "unwelcome": (json.dumps({"type": "welcome", "welcome": {"error": LONG}}),),
    "nested": (WELCOME, "[" * 20_000),
    "nested error": (WELCOME, json.dumps({"type": "error", "error": {"a": [LONG]}})),
    "no object": (WELCOME, "[1, 2]"),
}


@asynccontextmanager
async def saying(*words: str) -> AsyncIterator[str]:
    async def tell(client: ServerConnection) -> None:
        for word in words:
            await client.send(word)
        await client.wait_closed()

    async with serve(tell, "127.0.0.1", 0, close_timeout=0.1) as server:
        yield f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/v1"
        for connection in server.connections:
            connection.transport.abort()


def is_line(text: str) -> bool:
    return text.isprintable() and 0 < len(text) <= LONGEST


@pytest.mark.parametrize("words", WORDS.values(), ids=WORDS)
@in_loop
async def test_refusal_of_the_server_is_one_line(words: tuple[str, ...]) -> None:
    async with saying(*words) as url:
        with pytest.raises(MailboxRefuses) as raised:
            await Pair(url).call(PATIENCE)
    assert is_line(str(raised.value))


@asynccontextmanager
async def flooding(message: str) -> AsyncIterator[str]:
    async def flood(client: ServerConnection) -> None:
        await client.send(WELCOME)
        with suppress(ConnectionClosed):
            while True:
                await client.send(message)
                await asyncio.sleep(0)  # for whoever hears it in this process

    async with serve(flood, "127.0.0.1", 0, close_timeout=0.1) as server:
        yield f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/v1"


@in_loop
async def test_a_server_that_never_ends_its_messages_is_heard_for_a_bounded_time() -> None:
    message = json.dumps({"type": "message", "side": "x", "phase": "p", "body": "b" * 300})
    async with (
        asyncio.timeout(PATIENCE),
        flooding(message) as url,
        open_mailbox(url, Sealing(bytes(32), "slave")) as mailbox,
    ):
        assert len(await mailbox.stored()) == MOST_STORED


@in_loop
async def test_a_server_that_sends_anything_but_what_was_asked_for_is_left() -> None:
    async with asyncio.timeout(PATIENCE), flooding(json.dumps({"type": "ack"})) as url:
        with pytest.raises(MailboxRefuses, match="without end"):
            async with open_mailbox(url, Sealing(bytes(32), "slave")) as mailbox:
                await mailbox.stored()


@in_loop
async def test_a_message_of_a_megabyte_is_not_read() -> None:
    async with saying(WELCOME, json.dumps({"type": "message", "body": "b" * 1_000_000})) as url:
        with pytest.raises(MailboxUnreachable) as raised:
            async with open_mailbox(url, Sealing(bytes(32), "slave")) as mailbox:
                await mailbox.stored()
    assert is_line(str(raised.value))


@pytest.mark.parametrize("side", ["master", "slave"])
@in_loop
async def test_daemon_hears_of_a_long_refusal_and_the_finder_lives_on(side: str, tmp_path: Path) -> None:
    async with saying(*WORDS["error"]) as url:
        pair = Pair(url)
        peer = pair.slave if side == "master" else pair.master
        PeerStore(tmp_path).add(peer)
        order = FinderOrder(side, (peer.label,), str(tmp_path), peer.own, url)
        with running(("weberlink_anywhere.finder", order.to_json())) as end:
            end.setblocking(True)
            received = await asyncio.to_thread(hand_over.receive, end)
            assert received is not None and isinstance(news := received[0], PathNews)
            assert is_line(news.text) and "xxx" in news.text
            while select([end], [], [], 0.1)[0]:
                assert hand_over.receive(end) is not None, "the finder has ended"
