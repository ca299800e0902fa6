"""A session through coturn, a relay that others wrote: one end uses a channel of it, the other needs no relay."""

import asyncio
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest
import uvloop

from tests.protocol.aio.found import HOST, OPERATOR, ROBOT, End, bound_socket, engage, send_ticks
from tests.wait import soon
from weberlink.protocol import Role
from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.hand_over import PathFound, StunReceived
from weberlink.protocol.events import Address

stun = pytest.importorskip("aioice.stun")

pytestmark = pytest.mark.skipif(shutil.which("turnserver") is None, reason="coturn's turnserver is not installed")

CHANNEL = 0x4000
UDP = 17 << 24
LIFETIME_S = 600
PATIENCE_S = 10.0
OPTIONS = ("--no-auth", "--no-cli", "--no-tls", "--no-dtls", "--no-tcp", "--allow-loopback-peers", "--log-file=stdout")


@contextmanager
def turn_server(folder: Path) -> Iterator[Address]:
    """coturn on a free port of loopback, for anybody; yields its address."""
    with bound_socket() as probe:
        address: Address = probe.getsockname()
    places = (f"--listening-ip={HOST}", f"--relay-ip={HOST}", f"--listening-port={address[1]}")
    files = (f"--pidfile={folder / 'pid'}", f"--db={folder / 'db'}", "-n")
    with subprocess.Popen(["turnserver", *files, *places, *OPTIONS], stdout=subprocess.DEVNULL, cwd=folder) as server:
        try:
            yield address
        finally:
            server.kill()


class Client:
    """Asks a TURN server from one socket, with the messages of aioice."""

    def __init__(self, server: Address) -> None:
        self.socket = bound_socket()
        self.socket.settimeout(0.2)
        self._server = server

    def ask(self, method: Any, **attributes: Any) -> Any:
        """The attributes of the answer; asks again until the server is up."""
        named = {name.replace("_", "-"): value for name, value in attributes.items()}
        request = stun.Message(method, stun.Class.REQUEST, attributes=named)
        ends = monotonic() + PATIENCE_S
        while monotonic() < ends:
            with suppress(TimeoutError):
                self.socket.sendto(bytes(request), self._server)
                answer = stun.parse_message(self.socket.recv(2000))
                assert answer.message_class is stun.Class.RESPONSE, answer
                return answer.attributes
            sleep(0.05)
        raise AssertionError("turnserver does not answer")

    def allocate(self) -> Address:
        answer = self.ask(stun.Method.ALLOCATE, LIFETIME=LIFETIME_S, REQUESTED_TRANSPORT=UDP)
        address: Address = answer["XOR-RELAYED-ADDRESS"]
        return address

    def bind(self, peer: Address) -> None:
        self.ask(stun.Method.CHANNEL_BIND, CHANNEL_NUMBER=CHANNEL, XOR_PEER_ADDRESS=peer)


async def _session(master: End, slave: End, client: Client, server: Address) -> None:
    beyond = bound_socket()
    address = beyond.getsockname()
    relayed = client.allocate()
    client.bind(address)
    await slave.open()
    await master.open()
    master.find(client.socket.dup(), PathFound(1, 0, ROBOT, server, CHANNEL, "relayed", "coturn"))
    slave.find(beyond, PathFound(1, 0, OPERATOR, relayed))
    await engage(master, slave)
    await send_ticks(master, 1, 50)
    await soon(lambda: slave.ticks()[-1:] == [50], "the last update")
    assert master.endpoint.statistics.drops == slave.endpoint.statistics.drops == 0
    # The finder keeps the allocation alive on the same socket, and hears the answers through the daemon.
    refresh = stun.Message(stun.Method.REFRESH, stun.Class.REQUEST, attributes={"LIFETIME": LIFETIME_S})
    master.told()
    client.socket.sendto(bytes(refresh), server)
    heard: list[hand_over.Message] = []
    await soon(lambda: heard.extend(master.told()) or heard, "its answer")
    (answer,) = heard
    assert isinstance(answer, StunReceived) and answer.source == server
    assert stun.parse_message(answer.data).transaction_id == refresh.transaction_id


def test_session_through_coturn(tmp_path: Path) -> None:
    master, slave = End(Role.INITIATOR), End(Role.RESPONDER)

    async def bounded(client: Client, server: Address) -> None:
        async with asyncio.timeout(PATIENCE_S):
            await _session(master, slave, client, server)

    try:
        with turn_server(tmp_path) as server, asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            client = Client(server)
            with client.socket:
                runner.run(bounded(client, server))
    finally:
        master.close()
        slave.close()
