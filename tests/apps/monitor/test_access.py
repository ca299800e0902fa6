"""Access control: host names, origins, users, limits on connections."""

import os
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor import access
from weberlink.apps.monitor.access import Admission, origin


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1:8724", True),
        ("127.0.0.1", True),
        ("localhost:8724", True),
        ("LOCALHOST:9999", True),
        ("[::1]:8724", True),
        ("evil.example:8724", False),
        ("127.0.0.1.evil.example", False),
        ("evil.example@127.0.0.1", False),
        ("127.0.0.1:8724/x", False),
        ("192.0.2.1:8724", False),
        ("[::1", False),
        ("[::1]x", False),
        ("127.0.0.1:x", False),
        ("", False),
        (None, False),
    ],
)
def test_loopback_server_accepts_only_local_host_names(host: str | None, expected: bool) -> None:
    assert access.host_allowed(host, access.names("127.0.0.1")) is expected


@pytest.mark.parametrize(
    ("host", "expected"),
    [("192.0.2.1:8724", True), ("[2001:db8::1]", True), ("localhost", True), ("evil.example:8724", False)],
)
def test_public_server_accepts_addresses_but_no_foreign_name(host: str, expected: bool) -> None:
    assert access.host_allowed(host, access.names("0.0.0.0")) is expected
    assert access.host_allowed(host, access.names("::")) is expected


def test_single_served_address_is_the_only_host() -> None:
    allowed = access.names("192.0.2.7")
    assert access.host_allowed("192.0.2.7:8724", allowed)
    assert not access.host_allowed("127.0.0.1:8724", allowed)


@given(st.text())
def test_arbitrary_headers_never_raise(text: str) -> None:
    access.host_allowed(text, access.names("127.0.0.1"))
    assert access.origin_allowed(text, "127.0.0.1:1") is (text.lower() == "http://127.0.0.1:1")


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (None, True),
        ("http://127.0.0.1:8724", True),
        ("http://127.0.0.1:9999", False),
        ("https://127.0.0.1:8724", False),
        ("http://localhost:8724", False),
        ("http://evil.example", False),
        ("null", False),
    ],
)
def test_foreign_origins_are_refused(header: str | None, expected: bool) -> None:
    assert access.origin_allowed(header, "127.0.0.1:8724") is expected
    assert not access.origin_allowed("http://127.0.0.1:8724", None)


@pytest.mark.parametrize(("family", "address"), [(socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")])
def test_owner_of_a_local_connection_is_found(family: socket.AddressFamily, address: str, tmp_path: Path) -> None:
    with socket.socket(family) as server, socket.socket(family) as client:
        try:
            server.bind((address, 0))
        except OSError:
            pytest.skip(f"this host has no {address}")
        server.listen()
        client.connect(server.getsockname())
        accepted, peer = server.accept()
        with accepted:
            assert access.user_of(peer, accepted.getsockname()) == os.getuid()
            name = "tcp" if family == socket.AF_INET else "tcp6"
            table = Path(f"/proc/net/{name}").read_text()
            lines = []
            for line in table.splitlines():
                columns = line.split()
                columns[7] = "12345" if columns[7].isdigit() else columns[7]
                lines.append(" ".join(columns))
            (tmp_path / name).write_text("\n".join(lines))
            assert access.user_of(peer, accepted.getsockname(), tmp_path) == 12345
            assert access.user_of((peer[0], peer[1] ^ 1, *peer[2:]), accepted.getsockname()) is None
    assert access.is_own(os.getuid()) and access.is_own(0) and not access.is_own(12345) and not access.is_own(None)


def test_owner_of_a_remote_connection_is_unknown(tmp_path: Path) -> None:
    assert access.user_of(("192.0.2.1", 5), ("192.0.2.2", 6)) is None
    assert access.user_of(None, None) is None
    assert access.user_of(("127.0.0.1", 5), ("127.0.0.1", 6), tmp_path / "missing") is None


def test_full_group_loses_its_oldest_guest() -> None:
    admission: Admission[int] = Admission(10, 2)
    assert [admission.admit(guest, "a") for guest in range(4)] == [None, None, 0, 1]
    assert admission.admit(4, "b") is None


def test_full_house_expels_from_the_largest_group() -> None:
    admission: Admission[int] = Admission(4, 3)
    assert [admission.admit(guest, "many") for guest in range(3)] == [None] * 3
    assert [admission.admit(guest, f"one {guest}") for guest in range(3, 5)] == [None, 0]
    admission.leave(4)
    admission.leave(0)
    assert admission.admit(5, "one 5") is None


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 5)), max_size=60))
def test_newcomer_always_enters_within_the_limits(steps: list[tuple[bool, int]]) -> None:
    admission: Admission[int] = Admission(6, 3)
    inside: dict[int, int] = {}
    for guest, (leaves, group) in enumerate(steps):
        if leaves and inside:
            gone = next(iter(inside))
            admission.leave(gone)
            del inside[gone]
        expelled = admission.admit(guest, group)
        inside[guest] = group
        if expelled is not None:
            assert expelled != guest
            del inside[expelled]
        assert len(inside) <= 6
        counts = [list(inside.values()).count(each) for each in range(6)]
        assert max(counts) <= 3
        assert [admission.count(each) for each in range(6)] == counts


def test_origin_is_address_or_ipv6_network() -> None:
    assert origin("192.0.2.1") == origin("::ffff:192.0.2.1") != origin("192.0.2.2")
    assert origin("2001:db8::1") == origin("2001:db8::2") != origin("2001:db8:0:1::1")
    assert origin("fe80::1%eth0") == origin("fe80::2")
