"""The shipped relay is no open one, judged by the TURN of aioice; and it tells kinds of NAT."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from aioice import stun, turn

from plugins.anywhere.tests.namespaces import SERVER, needs_testbed
from plugins.anywhere.tests.testbed import BLOCKED, CONE, NONE, SECRET, SYMMETRIC, TURN_PORT, Home, Internet
from weberlink_anywhere.credentials import credentials
from weberlink_anywhere.nat import Behaviour
from weberlink_anywhere.stun import WayOut, find_way_out

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


# --- kinds of NAT of Linux routers, as the relay tells them

INDEPENDENT, BOTH = Behaviour.INDEPENDENT, Behaviour.ADDRESS_AND_PORT
KINDS = {NONE: (INDEPENDENT, INDEPENDENT), CONE: (INDEPENDENT, BOTH), SYMMETRIC: (BOTH, BOTH)}


@pytest.fixture(scope="module")
def homes(internet: Internet) -> dict[str, Home]:
    return {kind: internet.home(kind) for kind in (*KINDS, BLOCKED)}


def asked(home: Home, port: int = TURN_PORT) -> WayOut:
    with home.space.entered():
        return find_way_out([(SERVER, port)])


def test_kind_of_nat_and_blocked_udp_are_named(homes: dict[str, Home]) -> None:
    with ThreadPoolExecutor(len(homes)) as pool:  # they wait for answers that do not come
        found = dict(zip(homes, pool.map(asked, homes.values()), strict=True))
    assert found.pop(BLOCKED) == WayOut(None, by_tcp=(f"{SERVER}:{TURN_PORT}",))
    for kind, way_out in found.items():
        nat = way_out.nat
        assert nat is not None
        assert nat.is_translated is (kind != NONE)
        assert (nat.mapping, nat.filtering) == tuple(frozenset({each}) for each in KINDS[kind])


def test_server_that_is_down_is_no_blocked_udp(homes: dict[str, Home]) -> None:
    assert asked(homes[NONE], TURN_PORT + 7) == WayOut(None)
