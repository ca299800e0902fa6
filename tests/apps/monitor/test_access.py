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
    assert (access.refusal(host, None, access.names("127.0.0.1")) is None) is expected


@pytest.mark.parametrize(
    ("host", "expected"),
    [("192.0.2.1:8724", True), ("[2001:db8::1]", True), ("localhost", True), ("evil.example:8724", False)],
)
def test_public_server_accepts_addresses_but_no_foreign_name(host: str, expected: bool) -> None:
    assert (access.refusal(host, None, access.names("0.0.0.0")) is None) is expected
    assert (access.refusal(host, None, access.names("::")) is None) is expected


def test_single_served_address_is_the_only_host() -> None:
    allowed = access.names("192.0.2.7")
    assert access.refusal("192.0.2.7:8724", None, allowed) is None
    assert access.refusal("127.0.0.1:8724", None, allowed) is not None


@given(st.text())
def test_arbitrary_headers_never_raise(text: str) -> None:
    access.refusal(text, None, access.names("127.0.0.1"))
    is_own = text.lower() == "http://127.0.0.1:1"
    assert (access.refusal("127.0.0.1:1", text, access.names("127.0.0.1")) is None) is is_own


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
    assert (access.refusal("127.0.0.1:8724", header, access.names("127.0.0.1")) is None) is expected


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
