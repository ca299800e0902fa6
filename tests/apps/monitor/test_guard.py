"""Who may ask: names, origins, users."""

import os
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor import guard


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1:8765", True),
        ("127.0.0.1", True),
        ("localhost:8765", True),
        ("LOCALHOST:9999", True),
        ("[::1]:8765", True),
        ("evil.example:8765", False),
        ("127.0.0.1.evil.example", False),
        ("evil.example@127.0.0.1", False),
        ("127.0.0.1:8765/x", False),
        ("192.0.2.1:8765", False),
        ("[::1", False),
        ("[::1]x", False),
        ("127.0.0.1:x", False),
        ("", False),
        (None, False),
    ],
)
def test_a_page_of_this_host_is_asked_for_by_a_name_of_this_host(host: str | None, expected: bool) -> None:
    assert guard.host_allowed(host, guard.names("127.0.0.1")) is expected


@pytest.mark.parametrize(
    ("host", "expected"),
    [("192.0.2.1:8765", True), ("[2001:db8::1]", True), ("localhost", True), ("evil.example:8765", False)],
)
def test_served_on_every_address_any_address_will_do_but_no_foreign_name(host: str, expected: bool) -> None:
    assert guard.host_allowed(host, guard.names("0.0.0.0")) is expected
    assert guard.host_allowed(host, guard.names("::")) is expected


def test_one_address_that_is_served_is_the_only_one() -> None:
    allowed = guard.names("192.0.2.7")
    assert guard.host_allowed("192.0.2.7:8765", allowed)
    assert not guard.host_allowed("127.0.0.1:8765", allowed)


@given(st.text())
def test_no_header_breaks_the_guard(text: str) -> None:
    guard.host_allowed(text, guard.names("127.0.0.1"))
    assert guard.origin_allowed(text, "127.0.0.1:1") is (text.lower() == "http://127.0.0.1:1")


@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        (None, True),
        ("http://127.0.0.1:8765", True),
        ("http://127.0.0.1:9999", False),
        ("https://127.0.0.1:8765", False),
        ("http://localhost:8765", False),
        ("http://evil.example", False),
        ("null", False),
    ],
)
def test_only_pages_of_this_server_are_answered(origin: str | None, expected: bool) -> None:
    assert guard.origin_allowed(origin, "127.0.0.1:8765") is expected
    assert not guard.origin_allowed("http://127.0.0.1:8765", None)


@pytest.mark.parametrize(("family", "address"), [(socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")])
def test_the_kernel_says_whose_a_connection_is(family: socket.AddressFamily, address: str, tmp_path: Path) -> None:
    with socket.socket(family) as server, socket.socket(family) as client:
        try:
            server.bind((address, 0))
        except OSError:
            pytest.skip(f"this host has no {address}")
        server.listen()
        client.connect(server.getsockname())
        accepted, peer = server.accept()
        with accepted:
            assert guard.user_of(peer, accepted.getsockname()) == os.getuid()
            name = "tcp" if family == socket.AF_INET else "tcp6"
            table = Path(f"/proc/net/{name}").read_text()
            lines = []
            for line in table.splitlines():
                columns = line.split()
                columns[7] = "12345" if columns[7].isdigit() else columns[7]
                lines.append(" ".join(columns))
            (tmp_path / name).write_text("\n".join(lines))
            assert guard.user_of(peer, accepted.getsockname(), tmp_path) == 12345
            assert guard.user_of((peer[0], peer[1] ^ 1, *peer[2:]), accepted.getsockname()) is None
    assert guard.is_own(os.getuid()) and guard.is_own(0) and not guard.is_own(12345) and not guard.is_own(None)


def test_another_host_is_nobody_here(tmp_path: Path) -> None:
    assert guard.user_of(("192.0.2.1", 5), ("192.0.2.2", 6)) is None
    assert guard.user_of(None, None) is None
    assert guard.user_of(("127.0.0.1", 5), ("127.0.0.1", 6), tmp_path / "missing") is None
