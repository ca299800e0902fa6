"""The shipped relay is no open one; judged by the TURN of aioice."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
from aioice import stun, turn

from plugins.anywhere.tests.namespaces import SERVER, needs_testbed
from plugins.anywhere.tests.testbed import CONE, SECRET, TURN_PORT, Home, Internet
from weberlink_anywhere.credentials import credentials

pytestmark = needs_testbed
QUOTA = 24  # `user-quota` of the shipped file
LIFE_S = 60.0


@pytest.fixture(scope="module")
def host(internet: Internet) -> Home:
    return internet.home(CONE)


def valid(name: str = "op", since_s: float = 0.0, secret: str = SECRET) -> tuple[str, str]:
    return credentials(secret, name, time.time() + since_s, LIFE_S)


def within(host: Home, work: Callable[[], Coroutine[Any, Any, list[int]]]) -> list[int]:
    """Run to its end, with all its sockets on a host."""
    with host.space.entered():
        return asyncio.run(work())


async def client(username: str | None, password: str | None) -> turn.TurnClientUdpProtocol:
    _, protocol = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: turn.TurnClientUdpProtocol((SERVER, TURN_PORT), username, password, 600, 500),
        remote_addr=(SERVER, TURN_PORT),
    )
    return protocol


async def refused(request: Coroutine[Any, Any, Any]) -> int:
    try:
        await request
    except stun.TransactionFailed as refusal:
        code: int = refusal.response.attributes["ERROR-CODE"][0]
        return code
    return 0


async def allocations(users: list[tuple[str | None, str | None]]) -> list[int]:
    """Codes with which the relay answers allocations that last at the same time."""
    asking = [await client(*user) for user in users]
    try:
        codes = [await refused(one.connect()) for one in asking]
        for one, code in zip(asking, codes, strict=True):
            if not code:
                await one.delete()
    finally:
        for one in asking:
            one.transport.close()
    return codes


@pytest.mark.parametrize(
    ("code", "user"),
    [
        pytest.param(0, valid, id="valid"),
        pytest.param(401, lambda: (None, None), id="none"),
        pytest.param(0, lambda: valid(since_s=10.0 - LIFE_S), id="about to expire"),
        pytest.param(401, lambda: valid(since_s=-1.0 - LIFE_S), id="expired"),
        pytest.param(401, lambda: valid(secret="another-secret-of-16"), id="of a wrong secret"),
        pytest.param(401, lambda: (f"9{valid()[0]}", valid()[1]), id="prolonged"),
    ],
)
def test_relay_serves_valid_credentials_alone(host: Home, code: int, user: Callable[[], tuple[Any, Any]]) -> None:
    assert within(host, lambda: allocations([user()])) == [code]


def test_peers_that_are_not_public_are_refused(host: Home) -> None:
    private = ("127.0.0.1", "10.0.0.1", "172.16.0.1", "192.168.1.1", "169.254.169.254", "100.64.0.1", "0.0.0.0")
    peers = (*private, "224.0.0.1")

    async def ask() -> list[int]:
        asking = await client(*valid())
        await asking.connect()
        codes = [await refused(asking.channel_bind(0x4000 + i, (peer, 7))) for i, peer in enumerate(peers)]
        await asking.delete()
        return codes

    assert within(host, ask) == [403] * len(peers)


def test_user_gets_no_more_than_the_quota(internet: Internet) -> None:
    # coturn keeps the user of an address and port for a minute, and refuses another one there without a signature,
    # which aioice does not take for an answer; so a host of its own, at whose ports there was nobody.
    host = internet.home(CONE)
    greedy = [valid("greedy", number) for number in range(QUOTA + 2)]  # another expiry is the same user
    assert within(host, lambda: allocations(greedy)) == [0] * QUOTA + [486] * 2
