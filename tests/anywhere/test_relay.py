"""The shipped relay is no open one, and relays where no hole can be punched; judged by the TURN and ICE of aioice."""

import asyncio
import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import aioice
import pytest
from aioice import stun, turn

from tests.anywhere.namespaces import SERVER, Namespace, needs_testbed
from tests.anywhere.testbed import CONE, NONE, SECRET, SYMMETRIC, TURN_PORT, Home, Internet
from weberlink.anywhere.credentials import credentials

pytestmark = needs_testbed
Description = tuple[list[aioice.Candidate], str | None, str | None]
QUOTA = 24
"""`user-quota` of the shipped file."""


@pytest.fixture(scope="module")
def internet() -> Iterator[Internet]:
    with Internet() as internet:
        internet.start_relay()
        yield internet


@pytest.fixture(scope="module")
def host(internet: Internet) -> Home:
    return internet.home(CONE)


def valid(name: str = "op") -> tuple[str, str]:
    return credentials(SECRET, name, time.time(), 60.0)


def within(space: Namespace, work: Callable[[], Coroutine[Any, Any, Any]]) -> Any:
    """Run to its end, with all its sockets in a namespace."""
    with space.entered():
        return asyncio.run(work())


async def client(username: str | None, password: str | None) -> turn.TurnClientUdpProtocol:
    _, protocol = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: turn.TurnClientUdpProtocol((SERVER, TURN_PORT), username, password, 600, 500),
        remote_addr=(SERVER, TURN_PORT),
    )
    return protocol


async def refused(request: Coroutine[Any, Any, Any]) -> int:
    """Error code with which the relay answers a request; 0 if it grants it."""
    try:
        await request
    except stun.TransactionFailed as refusal:
        code: int = refusal.response.attributes["ERROR-CODE"][0]
        return code
    return 0


def refusal(host: Home, username: str | None, password: str | None) -> int:
    """Error code with which the relay refuses an allocation; 0 if it does not."""

    async def ask() -> int:
        asking = await client(username, password)
        code = await refused(asking.connect())
        if not code:
            await asking.delete()
        asking.transport.close()
        return code

    code: int = within(host.space, ask)
    return code


def test_valid_credentials_are_served(host: Home) -> None:
    assert refusal(host, *valid()) == 0


def test_no_credentials_are_refused(host: Home) -> None:
    assert refusal(host, None, None) == 401


def test_expired_credentials_are_refused(host: Home) -> None:
    assert refusal(host, *credentials(SECRET, "op", time.time() - 61.0, 60.0)) == 401


def test_credentials_of_a_wrong_secret_are_refused(host: Home) -> None:
    assert refusal(host, *credentials("another-secret-of-16", "op", time.time(), 60.0)) == 401


def test_prolonged_expiry_is_refused(host: Home) -> None:
    username, password = valid()
    assert refusal(host, f"9{username}", password) == 401


@pytest.mark.parametrize(
    "peer",
    ["127.0.0.1", "10.0.0.1", "172.16.0.1", "192.168.1.1", "169.254.169.254", "100.64.0.1", "0.0.0.0", "224.0.0.1"],
)
def test_peers_that_are_not_public_are_refused(host: Home, peer: str) -> None:
    async def ask() -> int:
        asking = await client(*valid(peer))
        await asking.connect()
        code = await refused(asking.channel_bind(0x4000, (peer, 7)))
        await asking.delete()
        return code

    assert within(host.space, ask) == 403


def test_user_gets_no_more_than_the_quota(host: Home) -> None:
    async def ask() -> list[int]:
        # Another expiry is the same user.
        users = [credentials(SECRET, "greedy", time.time() + number, 60.0) for number in range(QUOTA + 2)]
        asking = [await client(*user) for user in users]
        codes = [await refused(one.connect()) for one in asking]
        for one, code in zip(asking, codes, strict=True):
            if not code:
                await one.delete()
            one.transport.close()
        return codes

    assert within(host.space, ask) == [0] * QUOTA + [486] * 2


class Agent:
    """An ICE agent of aioice on a host, in a thread of its own.

    Args:
        is_controlling: as in RFC 8445.
    """

    def __init__(self, host: Home, *, is_controlling: bool) -> None:
        self._host, self._is_controlling = host, is_controlling
        self.description: Future[Description] = Future()

    def connect(self, other: "Agent", relay: tuple[str, int] | None) -> tuple[str, str]:
        """Types of the local and the remote candidate of the path over which a message came."""

        async def work() -> tuple[str, str]:
            username, password = valid(f"agent{self._is_controlling}")
            connection = aioice.Connection(
                self._is_controlling,
                stun_server=(SERVER, TURN_PORT),
                turn_server=relay,
                turn_username=username,
                turn_password=password,
            )
            await connection.gather_candidates()
            self.description.set_result(
                (connection.local_candidates, connection.local_username, connection.local_password)
            )
            candidates, connection.remote_username, connection.remote_password = await asyncio.wrap_future(
                other.description
            )
            for candidate in [*candidates, None]:
                await connection.add_remote_candidate(candidate)
            await connection.connect()
            await connection.send(b"hello")
            assert await connection.recv() == b"hello"
            pair = connection._nominated[1]
            await connection.close()
            return pair.local_candidate.type, pair.remote_candidate.type

        types: tuple[str, str] = within(self._host.space, work)
        return types


@pytest.mark.parametrize(
    ("one", "other", "is_relayed"),
    [(NONE, SYMMETRIC, False), (CONE, CONE, False), (CONE, SYMMETRIC, True), (SYMMETRIC, SYMMETRIC, True)],
)
def test_ice_needs_the_relay_only_where_no_hole_can_be_punched(
    internet: Internet, one: str, other: str, *, is_relayed: bool
) -> None:
    agents = Agent(internet.home(one), is_controlling=True), Agent(internet.home(other), is_controlling=False)
    relay = (SERVER, TURN_PORT) if is_relayed else None
    with ThreadPoolExecutor(2) as threads:
        found = list(threads.map(Agent.connect, agents, agents[::-1], (relay, relay), timeout=10.0))
    assert ("relay" in {*found[0], *found[1]}) is is_relayed
