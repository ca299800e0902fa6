"""Known peers: the store, complete or not at all, for its owner alone; and `weberlink peer`."""

import json
import os
import stat
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.meetings import Pair
from tests.strangers import NOBODY, needs_root
from weberlink.cli import app
from weberlink.order import MISCONFIGURED
from weberlink.protocol.keys import HeldKey, Right
from weberlink.testing.time import running_time
from weberlink_anywhere.peers import Peer, PeerError, PeerStore
from weberlink_anywhere.survey import ASK_LIMIT_S

ROBOT = Peer("robot", "arm-7", "anna", "slave", bytes(range(32)), "ws://relay.example:4000/v1", 1.5e9)
GOOD = b'{"label": null, "name": "a", "own": "b", "role": "slave", "key": "%s"}' % (b"00" * 32)


@pytest.fixture
def store(tmp_path: Path) -> PeerStore:
    made, before = PeerStore(tmp_path / "some" / "peers"), os.umask(0)
    try:
        assert list(made) == []
        made.add(ROBOT)
    finally:
        os.umask(before)
    return made


def test_peers_are_kept_as_they_were_for_their_owner_alone(store: PeerStore) -> None:
    others = [replace(ROBOT, label=label, role="master") for label in ("Ann's desk", "anna@lab", "机器人")]
    for peer in others:
        store.add(peer)
    assert sorted(store, key=lambda peer: peer.label) == sorted([ROBOT, *others], key=lambda peer: peer.label)
    modes = [stat.S_IMODE(path.stat().st_mode) for path in (store.folder, store.folder / "robot.json")]
    assert modes == [0o700, 0o600]


def test_rename_keeps_all_but_the_label_and_nothing_is_overwritten(store: PeerStore) -> None:
    with pytest.raises(PeerError, match="robot is known already; remove it first: weberlink peer robot --remove"):
        store.add(replace(ROBOT, key=bytes(32)))
    assert [path.name for path in store.folder.iterdir()] == ["robot.json"], "no draft is left"
    store.rename("robot", "lab")
    assert list(store) == [replace(ROBOT, label="lab")]
    store.add(ROBOT)
    with pytest.raises(PeerError, match="there is a peer 'lab' already"):
        store.rename("robot", "lab")
    for do in (store.find, store.remove):
        with pytest.raises(PeerError, match="there is no peer 'arm'; known: lab, robot"):
            do("arm")


@pytest.mark.parametrize("label", ["", ".", "..", ".robot", "a/b", "../robot", "a\nb", "a\0b", "é" * 126, "\ud800"])
def test_label_is_no_path(store: PeerStore, label: str) -> None:
    for do in (
        lambda: store.add(replace(ROBOT, label=label)),
        lambda: store.rename("robot", label),
        lambda: store.find(label),
        lambda: store.remove(label),
    ):
        with pytest.raises(PeerError, match="a peer cannot be called"):
            do()  # type: ignore[no-untyped-call]
    assert list(store) == [ROBOT]


@pytest.mark.parametrize(
    "content",
    [
        *(
            b"",
            b"[]",
            b"[" * 4000,
            GOOD[:-1],
            GOOD.replace(b'"a"', b'"%s"' % (b"a" * 5000)),
            GOOD.replace(b"00", b"0", 1),
        ),
        *(GOOD.replace(b'"slave"', b'"both"'), GOOD.replace(b'"a"', b"7")),
        GOOD.replace(b'"name"', b'"paired_at": "now", "name"'),
    ],
    ids=range(9),
)
def test_broken_file_is_told_and_can_be_removed(store: PeerStore, content: bytes) -> None:
    path = store.folder / "robot.json"
    path.write_bytes(content)
    for read in (lambda: list(store), lambda: store.find("robot")):
        with pytest.raises(PeerError, match=f"{path} is not the file of a peer; remove it, and pair again"):
            read()
    path.write_bytes(GOOD)
    assert store.find("robot").key == bytes(32), "otherwise it would be good"
    path.write_bytes(content)
    store.remove("robot")
    assert store.labels() == []


@pytest.mark.parametrize(
    ("name", "mode", "good"), [("robot.json", 0o640, 0o600), ("", 0o720, 0o700), ("", 0o702, 0o700)]
)
def test_what_others_may_read_or_write_is_refused_with_the_remedy(
    store: PeerStore, name: str, mode: int, good: int
) -> None:
    path = store.folder / name
    path.chmod(mode)
    with pytest.raises(PeerError, match=f"chmod {good:o} {path}"):
        store.find("robot")
    path.chmod(good)
    assert store.find("robot") == ROBOT


@needs_root
def test_a_folder_of_another_user_is_refused(store: PeerStore) -> None:
    os.chown(store.folder, NOBODY, NOBODY)
    with pytest.raises(PeerError, match="peers belongs to another user"):
        store.labels()


def test_of_many_at_once_one_adds(tmp_path: Path) -> None:
    store = PeerStore(tmp_path)

    def add(number: int) -> int | None:
        try:
            store.add(replace(ROBOT, key=bytes([number]) * 32))
        except PeerError:
            return None
        return number

    with ThreadPoolExecutor(8) as pool:
        (winner,) = [each for each in pool.map(add, range(32)) if each is not None]
    assert store.find("robot").key == bytes([winner]) * 32
    assert [path.name for path in store.folder.iterdir()] == ["robot.json"]


NOWHERE = "ws://127.0.0.1:1/v1"


@pytest.fixture
def empty(tmp_path: Path) -> PeerStore:
    return PeerStore(tmp_path / "peers")


def peers(empty: PeerStore, *arguments: str) -> Result:
    return CliRunner().invoke(app, ["peer", *arguments, "--store", str(empty.folder)])


@pytest.mark.realtime
def test_all_are_asked_at_once_and_each_state_is_told(mailbox: MailboxServer, empty: PeerStore, tmp_path: Path) -> None:
    far, *away = [Pair(mailbox.url) for _ in range(7)]
    empty.add(replace(far.slave, label="far", mailbox=NOWHERE))
    empty.add(replace(far.slave, label="unserved", mailbox=""))
    empty.add(replace(far.master, label="anna"))
    for number, pair in enumerate(away):
        empty.add(replace(pair.slave, label=f"away {number}"))
    (empty.folder / "broken.json").touch(0o600)
    out = tmp_path / "out.json"
    with running_time() as ran:
        result = peers(empty, "--json", str(out))
    assert ran() < 2 * ASK_LIMIT_S, "not one after the other"
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


def test_one_peer_is_renamed_shown_and_removed(empty: PeerStore) -> None:
    empty.add(Pair("").slave)
    empty.add(replace(Pair("").slave, label="other"))
    assert peers(empty, "robot", "--rename", "arm").stdout == "robot is now called arm\n"
    shown = json.loads(peers(empty, "arm", "--json", "-").stdout)
    assert [(each["label"], each["name"]) for each in shown["peers"]] == [("arm", "robot")]
    assert peers(empty, "arm", "--remove").stdout.startswith("arm is forgotten; ")
    assert empty.labels() == ["other"]


def test_the_right_of_an_operator_is_changed_and_its_file_decides(empty: PeerStore) -> None:
    anna = Pair("").master
    empty.add(anna)
    assert empty.find("anna").right is Right.DRIVE
    assert peers(empty, "anna", "--right", "stop").stdout.startswith("anna may stop")
    assert empty.find("anna") == replace(anna, right=Right.STOP)
    assert empty.find("anna").held_key == HeldKey(anna.key, Right.STOP, "anna")
    assert "master, stops" in peers(empty, "--offline").stdout
    file = empty.folder / "anna.json"
    assert (file.stat().st_mode & 0o777, [*empty.folder.iterdir()]) == (0o600, [file])
    file.write_text(file.read_text().replace('"stop"', '"rule"'))
    with pytest.raises(PeerError, match="is not the file of a peer"):
        empty.find("anna")
    assert list(empty.usable()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *((f"nobody {rest}", "there is no peer 'nobody'; known: robot") for rest in ("", "--remove", "--rename x")),
        ("robot --right stop", "robot is a robot: what this host may do there is for its own host to say"),
        ("robot --right stop --remove", "one of --rename NEW, --right and --remove"),
        ("robot --rename ../x", "a peer cannot be called '../x'"),
        *(
            (each, "one of --rename NEW, --right and --remove")
            for each in ("robot --rename x --remove", "--remove", "--rename x")
        ),
    ],
)
def test_wrong_arguments_change_nothing(empty: PeerStore, arguments: str, message: str) -> None:
    empty.add(Pair("").slave)
    result = peers(empty, *arguments.split())
    assert result.exit_code == MISCONFIGURED
    assert result.stderr.startswith("weberlink: peer: ") and message in result.stderr
    assert (result.stderr.count("\n"), empty.labels()) == (1, ["robot"])
