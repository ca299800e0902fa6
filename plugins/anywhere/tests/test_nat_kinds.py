"""Kinds of NAT of Linux routers, as doctor names them and as turnutils_natdiscovery of coturn does."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from plugins.anywhere.tests.namespaces import SERVER, needs_testbed
from plugins.anywhere.tests.testbed import BLOCKED, CONE, NONE, SYMMETRIC, TURN_PORT, Home, Internet
from weberlink_anywhere.nat import Behaviour
from weberlink_anywhere.stun import WayOut, find_way_out

pytestmark = needs_testbed
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
