"""The test bed itself, judged by plain sockets, coturn and aioice, without any code of this project."""

import socket
from collections.abc import Iterator
from pathlib import Path
from select import select
from time import monotonic

import pytest
from aioice import stun

from tests.anywhere.namespaces import SERVER, Namespace, needs_testbed, run
from tests.anywhere.testbed import BLOCKED, CONE, NONE, SECOND_SERVER, SYMMETRIC, TURN_PORT, Home, Internet

pytestmark = needs_testbed
SERVERS = ((SERVER, TURN_PORT), (SERVER, TURN_PORT + 1), (SECOND_SERVER, TURN_PORT))


@pytest.fixture(scope="module")
def internet() -> Iterator[Internet]:
    with Internet() as internet:
        internet.start_relay()
        yield internet


@pytest.fixture(scope="module")
def homes(internet: Internet) -> dict[str, tuple[Home, Home]]:
    """Two of each kind."""
    return {nat: (internet.home(nat), internet.home(nat)) for nat in (NONE, CONE, SYMMETRIC)}


def udp(space: Namespace, interface: str = "") -> socket.socket:
    with space.entered():
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if interface:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode())
    made.bind(("0.0.0.0", 0))
    made.settimeout(5.0)
    return made


def mapped(asking: socket.socket, server: tuple[str, int] = SERVERS[0], patience: float = 5.0) -> tuple[str, int]:
    """Address of a socket, as a STUN server sees it.

    Raises:
        TimeoutError: no answer.
    """
    asking.settimeout(patience)
    request = stun.Message(stun.Method.BINDING, stun.Class.REQUEST)
    asking.sendto(bytes(request), server)
    while True:
        data, source = asking.recvfrom(2048)
        if source == server:
            seen: tuple[str, int] = stun.parse_message(data).attributes["XOR-MAPPED-ADDRESS"]
            return seen


def punch(one: socket.socket, other: socket.socket, patience: float) -> bool:
    """Whether two sockets reach each other: both send to where STUN saw the other, and answer."""
    addresses = {one: mapped(other), other: mapped(one)}
    heard: set[socket.socket] = set()
    deadline = monotonic() + patience
    while len(heard) < 2 and monotonic() < deadline:
        for end, address in addresses.items():
            end.sendto(b"ask", address)
        for end in select([one, other], [], [], 0.05)[0]:
            data, source = end.recvfrom(100)
            heard.add(end)
            if data == b"ask":
                end.sendto(b"answer", source)
    return len(heard) == 2


def hears(end: socket.socket, patience: float = 0.3) -> bool:
    return bool(select([end], [], [], patience)[0])


def test_host_without_nat_is_seen_as_it_is(homes: dict[str, tuple[Home, Home]]) -> None:
    host = homes[NONE][0]
    with udp(host.space) as asking:
        assert mapped(asking) == (host.first.address, asking.getsockname()[1])


def test_cone_maps_all_destinations_to_one_port(homes: dict[str, tuple[Home, Home]]) -> None:
    host = homes[CONE][0]
    with udp(host.space) as asking:
        seen = {mapped(asking, server) for server in SERVERS}
        assert seen == {(host.first.outside, next(iter(seen))[1])}
        assert next(iter(seen))[1] != asking.getsockname()[1]


def test_symmetric_maps_each_destination_to_another_port(homes: dict[str, tuple[Home, Home]]) -> None:
    host = homes[SYMMETRIC][0]
    with udp(host.space) as asking:
        seen = [mapped(asking, server) for server in SERVERS]
        assert {address for address, _ in seen} == {host.first.outside}
        assert len({port for _, port in seen}) == len(SERVERS)
        assert [mapped(asking, server) for server in SERVERS] == seen


def test_blocked_passes_tcp_and_no_udp(internet: Internet) -> None:
    host = internet.home(BLOCKED)
    with udp(host.space) as asking, pytest.raises(TimeoutError):
        mapped(asking, patience=0.3)
    with host.space.entered():
        socket.create_connection((SERVER, TURN_PORT), timeout=2.0).close()


@pytest.mark.parametrize(
    ("one", "other", "is_punched"),
    [
        (NONE, NONE, True),
        (NONE, SYMMETRIC, True),
        (CONE, CONE, True),
        (CONE, SYMMETRIC, False),
        (SYMMETRIC, CONE, False),
        (SYMMETRIC, SYMMETRIC, False),
    ],
)
def test_holes_are_punched_through_cones_only(
    homes: dict[str, tuple[Home, Home]], one: str, other: str, *, is_punched: bool
) -> None:
    with udp(homes[one][0].space) as a, udp(homes[other][1].space) as b:
        assert punch(a, b, 5.0 if is_punched else 0.4) is is_punched


def test_stranger_does_not_enter_a_mapping(homes: dict[str, tuple[Home, Home]]) -> None:
    inside, outside = homes[CONE][0], homes[NONE][0]
    with udp(inside.space) as asking, udp(outside.space) as stranger:
        stranger.sendto(b"hello", mapped(asking))
        assert not hears(asking)


def test_strangers_first_datagram_does_not_move_the_mapping(homes: dict[str, tuple[Home, Home]]) -> None:
    inside, outside = homes[CONE][0], homes[NONE][0]
    with udp(inside.space) as asking, udp(outside.space) as stranger:
        before = mapped(asking)
        stranger.sendto(b"too early", before)
        asking.sendto(b"hello", (outside.first.address, stranger.getsockname()[1]))
        assert stranger.recvfrom(100)[1] == before


@pytest.mark.parametrize("nat", [CONE, SYMMETRIC])
def test_forgotten_mapping_comes_back_at_another_port(homes: dict[str, tuple[Home, Home]], nat: str) -> None:
    host = homes[nat][0]
    with udp(host.space) as asking:
        before = mapped(asking)
        assert mapped(asking) == before
        host.first.forget()
        assert mapped(asking) != before


def test_unused_mapping_times_out(internet: Internet) -> None:
    host = internet.home(SYMMETRIC)
    host.first.set_timeout(1)
    with udp(host.space) as asking:
        before = mapped(asking)
        assert not hears(asking, 1.5)
        assert mapped(asking) != before


def test_router_with_a_new_address_is_seen_there(internet: Internet) -> None:
    host = internet.home(CONE)
    with udp(host.space) as asking:
        mapped(asking)
        host.first.renumber()
        assert mapped(asking)[0] == host.first.outside


def test_two_interfaces_have_two_public_addresses(internet: Internet) -> None:
    host = internet.home(CONE, second=SYMMETRIC)
    assert host.second is not None
    with udp(host.space, "wifi") as wifi, udp(host.space, "phone") as phone, udp(host.space) as any_:
        assert mapped(wifi)[0] == mapped(any_)[0] == host.first.outside
        assert mapped(phone)[0] == host.second.outside
        host.first.unplug()
        assert mapped(any_)[0] == mapped(phone)[0] == host.second.outside
        host.first.connect_host()
        assert mapped(any_)[0] == host.first.outside


def test_silent_router_loses_datagrams_both_ways(internet: Internet) -> None:
    host = internet.home(NONE)
    with udp(host.space) as asking:
        mapped(asking)
        host.first.set_silent(True)
        with pytest.raises(TimeoutError):
            mapped(asking, patience=0.3)
        host.first.set_silent(False)
        assert mapped(asking)[0] == host.first.address
        host.first.readdress()
    with udp(host.space) as asking:
        assert mapped(asking)[0] == host.first.address


def test_server_is_known_by_name(internet: Internet) -> None:
    host = internet.home(CONE)
    script = "import socket; print(socket.gethostbyname('relay.example'))"
    assert host.space.output("python3", "-c", script).strip() == SERVER


def test_nothing_is_left_after_the_block() -> None:
    with Internet() as internet:
        host = internet.home(CONE)
        sleeper = host.space.popen("sleep", "60")
        assert host.space.name in run("ip", "netns", "list")
    assert sleeper.wait(5.0) < 0
    assert host.space.name not in run("ip", "netns", "list")
    assert not Path("/etc/netns", host.space.name).exists()
