"""Access control: host names, origins and the token."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor import access


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


def test_the_token_outlives_a_restart_and_is_of_this_user_alone(tmp_path: Path) -> None:
    token = access.kept_token(tmp_path)
    assert access.kept_token(tmp_path) == token
    (path,) = tmp_path.iterdir()
    assert path.stat().st_mode & 0o777 == 0o600
    path.write_text("")  # as a full disk leaves it
    other = access.kept_token(tmp_path)
    assert len(other) == len(token)
    assert other != token
    assert access.kept_token(tmp_path) == other
