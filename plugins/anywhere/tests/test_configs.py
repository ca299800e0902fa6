"""The shipped file, the secrets it names, and what the doctor says of NAT and firewall."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from plugins.anywhere.tests import FILE
from weberlink.config import ConfigurationError, load
from weberlink.protocol.keys import KeyFileError
from weberlink.session.ending import Connection
from weberlink.session.simulation import simulate
from weberlink.telemetry.reader import Records
from weberlink_anywhere.credentials import credentials, read_credentials, read_secret
from weberlink_anywhere.doctor import judge, mailbox
from weberlink_anywhere.nat import ANY, Behaviour, Nat
from weberlink_anywhere.options import AnywhereOptions
from weberlink_anywhere.stun import WayOut
from weberlink_doctor.report import Grade

HERE = ("link.finder=null", "link.listen=127.0.0.1:47000", "link.security=none")


def test_it_is_connected_from_start_to_end() -> None:
    times = {side: Connection() for side in ("master", "slave")}

    def watch(*records: Records) -> None:
        for side, new in zip(times.values(), records, strict=True):
            side.add(new)

    emulate = "link.emulate={delay_ms: 100, jitter_ms: 5, loss: 0.02, seed: 1}"
    facts = simulate(load(FILE, (*HERE, emulate)), 3.0, [watch])
    assert (facts["outcome"], facts["faults"]) == ("completed", {"master": {}, "slave": {}})
    assert all(each.interruptions == 0 for each in times.values())


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        (("mailbox=relay.example:4000",), "link.finder.mailbox: must be the address of a mailbox server"),
        (("mailbox=null",), "path ice needs mailbox"),
        (("turn={server: a:1}",), "link.finder.turn: needs secret_file or credentials_file"),
        (("path=direct", "paths=2"), "paths and interfaces need path: ice"),
    ],
)
def test_a_wrong_value_is_one_line(overrides: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=complaint):
        load(FILE, [f"link.finder.{each}" for each in overrides])


SECRET = "north-star-of-the-relay"


def file_of(folder: Path, content: str, mode: int = 0o600) -> Path:
    path = folder / "turn.secret"
    path.write_text(content)
    path.chmod(mode)
    return path


def test_password_is_hmac_of_expiry_and_name() -> None:
    # printf 1000000600:op | openssl dgst -sha1 -hmac north-star-of-the-relay -binary | base64
    assert credentials(SECRET, "op", 1e9, 600.0) == ("1000000600:op", "eu05EBFpQGhiMsHYObQnILIDjUk=")


def test_file_holds_a_secret_or_name_and_password(tmp_path: Path) -> None:
    assert read_secret(file_of(tmp_path, f"{SECRET}\n")) == SECRET
    assert read_secret(file_of(tmp_path, "s" * 16)) == "s" * 16
    assert read_credentials(file_of(tmp_path, "name password\n")) == ("name", "password")


@pytest.mark.parametrize(
    ("read", "content", "mode"),
    [
        *((read_secret, content, 0o600) for content in ("", "two words", "s\u00e4cret-of-the-relay", "s" * 15)),
        (read_secret, SECRET, 0o640),
        (read_credentials, "name", 0o600),
        (read_credentials, "name password more", 0o600),
    ],
)
def test_other_files_are_refused(read: Callable[[Path], object], content: str, mode: int, tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match=r"turn\.secret"):
        read(file_of(tmp_path, content, mode))


FILE_OPTIONS = {"mailbox": "wss://a/v1", "stun": "relay.example:3478", "turn": {"server": "a:1", "secret_file": "s"}}
SERVER, MINE = ("203.0.113.1", 3478), ("198.51.100.7", 20_000)
INDEPENDENT, BOTH = frozenset({Behaviour.INDEPENDENT}), frozenset({Behaviour.ADDRESS_AND_PORT})
MAPPED, UNCLEAR = WayOut(Nat(SERVER, MINE, True, BOTH, BOTH)), WayOut(Nat(SERVER, MINE, True, ANY, ANY))
REACHED = WayOut(Nat(SERVER, MINE, True, INDEPENDENT, INDEPENDENT))
BLOCKED = WayOut(None, by_tcp=("relay.example:3478",))


@pytest.mark.parametrize(
    ("url", "is_said"),
    [("ws://relay.example:4000/v1", True), ("wss://relay.example:4000/v1", False), ("ws://127.0.0.1:4000/v1", False)],
)
def test_a_mailbox_without_encryption_is_advised_against(url: str, is_said: bool) -> None:
    found = [*mailbox(AnywhereOptions.model_validate(FILE_OPTIONS | {"mailbox": url}))]
    assert [each.grade for each in found] == [Grade.ADVICE] * is_said


@pytest.mark.parametrize(
    ("way_out", "overrides", "grade", "fix"),
    [
        (REACHED, {}, Grade.OK, None),
        (MAPPED, {}, Grade.OK, None),  # the file has a relay
        (MAPPED, {"turn": None}, Grade.ADVICE, "link.finder.turn"),
        (UNCLEAR, {}, Grade.UNKNOWN, "docs/relay.md"),
        (BLOCKED, {}, Grade.PROBLEM, "another network"),
        (WayOut(None, unresolved=("a.b",)), {}, Grade.PROBLEM, "link.finder.stun"),
    ],
)
def test_way_out_is_judged(way_out: WayOut, overrides: dict[str, Any], grade: Grade, fix: str | None) -> None:
    first, *others = judge(way_out, AnywhereOptions.model_validate(FILE_OPTIONS | overrides))
    assert first.grade is grade
    assert first.fix is None if fix is None else fix in (first.fix or "")
    assert [(each.check, each.grade) for each in others] == [("filtering", Grade.OK)] * (way_out.nat is not None)
