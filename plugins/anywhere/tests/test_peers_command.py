"""`weberlink peer`: who is known, who waits, and what is wrong with the rest."""

import json
from dataclasses import replace
from pathlib import Path
from time import monotonic

import pytest
from typer.testing import CliRunner, Result

from plugins.anywhere.tests.mailbox_server import MailboxServer, mailbox
from plugins.anywhere.tests.meetings import Pair
from weberlink.cli import app
from weberlink.order import MISCONFIGURED
from weberlink_anywhere.peers import PeerStore
from weberlink_anywhere.survey import ASK_LIMIT_S

__all__ = ["mailbox"]
NOWHERE = "ws://127.0.0.1:1/v1"


@pytest.fixture
def store(tmp_path: Path) -> PeerStore:
    return PeerStore(tmp_path / "peers")


def peers(store: PeerStore, *arguments: str) -> Result:
    return CliRunner().invoke(app, ["peer", *arguments, "--store", str(store.folder)])


@pytest.mark.realtime
def test_all_are_asked_at_once_and_each_state_is_told(mailbox: MailboxServer, store: PeerStore, tmp_path: Path) -> None:
    far, *away = [Pair(mailbox.url) for _ in range(7)]
    store.add(replace(far.slave, label="far", mailbox=NOWHERE))
    store.add(replace(far.slave, label="unserved", mailbox=""))
    store.add(replace(far.master, label="anna"))
    for number, pair in enumerate(away):
        store.add(replace(pair.slave, label=f"away {number}"))
    (store.folder / "broken.json").touch(0o600)
    out, began = tmp_path / "out.json", monotonic()
    result = peers(store, "--json", str(out))
    assert monotonic() - began < 2 * ASK_LIMIT_S, "not one after the other"
    assert (result.exit_code, result.stderr) == (0, "")
    assert {each["label"]: (each["state"], each["serves"]) for each in json.loads(out.read_text())["peers"]} == {
        "anna": ("-", None),
        **{f"away {number}": ("away", None) for number in range(len(away))},
        "broken": ("unusable", None),
        "far": ("unknown", None),
        "unserved": ("unknown", None),
    }
    assert f"far: the mailbox server {NOWHERE} cannot be reached: Connection refused" in result.stdout
    keys = [pair.master.key.hex() for pair in (far, *away)]
    assert not any(key in text for key in keys for text in (result.stdout, out.read_text()))


def test_one_peer_is_renamed_shown_and_removed(store: PeerStore) -> None:
    store.add(Pair("").slave)
    store.add(replace(Pair("").slave, label="other"))
    assert peers(store, "robot", "--rename", "arm").stdout == "robot is now called arm\n"
    shown = json.loads(peers(store, "arm", "--json", "-").stdout)
    assert [(each["label"], each["name"]) for each in shown["peers"]] == [("arm", "robot")]
    assert peers(store, "arm", "--remove").stdout.startswith("arm is forgotten; ")
    assert store.labels() == ["other"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *((f"nobody {rest}", "there is no peer 'nobody'; known: robot") for rest in ("", "--remove", "--rename x")),
        ("robot --rename ../x", "a peer cannot be called '../x'"),
        *((each, "--rename NEW and --remove") for each in ("robot --rename x --remove", "--remove", "--rename x")),
    ],
)
def test_wrong_arguments_change_nothing(store: PeerStore, arguments: str, message: str) -> None:
    store.add(Pair("").slave)
    result = peers(store, *arguments.split())
    assert result.exit_code == MISCONFIGURED
    assert result.stderr.startswith("weberlink: peer: ") and message in result.stderr
    assert (result.stderr.count("\n"), store.labels()) == (1, ["robot"])
