"""The store of known peers: complete or not at all, for its owner alone, and no key is ever overwritten."""

import os
import stat
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.strangers import NOBODY, as_stranger, needs_root, read_file
from weberlink_anywhere.peers import Peer, PeerError, PeerStore

ROBOT = Peer("robot", "arm-7", "anna", "slave", bytes(range(32)), "ws://relay.example:4000/v1", 1.5e9)


@pytest.fixture
def store(tmp_path: Path) -> PeerStore:
    return PeerStore(tmp_path / "some" / "peers")


def put(store: PeerStore, content: bytes, label: str = "robot") -> Path:
    """A file in the place of a peer's."""
    store.add(replace(ROBOT, label=label))
    path = store.folder / f"{label}.json"
    path.write_bytes(content)
    return path


def test_peers_are_kept_as_they_were(store: PeerStore) -> None:
    assert list(store) == []
    others = [replace(ROBOT, label=label, role="master") for label in ("Ann's desk", "anna@lab", "机器人")]
    for peer in (ROBOT, *others):
        store.add(peer)
    assert sorted(store, key=lambda peer: peer.label) == sorted([ROBOT, *others], key=lambda peer: peer.label)
    assert store.find("robot") == ROBOT


def test_store_is_open_to_its_owner_alone(store: PeerStore) -> None:
    before = os.umask(0)
    try:
        store.add(ROBOT)
    finally:
        os.umask(before)
    modes = [stat.S_IMODE(path.stat().st_mode) for path in (store.folder, store.folder / "robot.json")]
    assert modes == [0o700, 0o600]


def test_known_peer_is_not_overwritten(store: PeerStore) -> None:
    store.add(ROBOT)
    with pytest.raises(PeerError, match="robot is known already; remove it first: weberlink peer robot --remove"):
        store.add(replace(ROBOT, key=bytes(32)))
    assert list(store) == [ROBOT]
    assert [path.name for path in store.folder.iterdir()] == ["robot.json"], "no draft is left"


def test_rename_keeps_all_but_the_label(store: PeerStore) -> None:
    store.add(ROBOT)
    store.rename("robot", "lab")
    assert list(store) == [replace(ROBOT, label="lab")]
    store.add(ROBOT)
    with pytest.raises(PeerError, match="there is a peer 'lab' already"):
        store.rename("robot", "lab")
    assert len(list(store)) == 2


def test_unknown_peer_is_told_beside_the_known(store: PeerStore) -> None:
    store.add(ROBOT)
    for do in (store.find, store.remove):
        with pytest.raises(PeerError, match="there is no peer 'arm'; known: robot"):
            do("arm")


@pytest.mark.parametrize("label", ["", ".", "..", ".robot", "a/b", "../robot", "a\nb", "a\0b", "é" * 126, "\ud800"])
def test_label_is_no_path(store: PeerStore, label: str) -> None:
    store.add(ROBOT)
    for do in (lambda: store.add(replace(ROBOT, label=label)), lambda: store.rename("robot", label)):
        with pytest.raises(PeerError, match="a peer cannot be called"):
            do()
    for do in (lambda: store.find(label), lambda: store.remove(label)):  # type: ignore[assignment]
        with pytest.raises(PeerError, match="a peer cannot be called"):
            do()
    assert list(store) == [ROBOT]


GOOD = b'{"label": null, "name": "a", "own": "b", "role": "slave", "key": "%s"}' % (b"00" * 32)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"[" * 4000,
        GOOD[:-1],
        GOOD.replace(b'"a"', b'"%s"' % (b"a" * 5000)),
        GOOD.replace(b"00", b"0", 1),
        GOOD.replace(b'"slave"', b'"both"'),
        GOOD.replace(b'"a"', b"7"),
        GOOD.replace(b'"name"', b'"paired_at": "now", "name"'),
    ],
    ids=range(9),
)
def test_broken_file_is_told_and_can_be_removed(store: PeerStore, content: bytes) -> None:
    path = put(store, content)
    for read in (lambda: list(store), lambda: store.find("robot")):
        with pytest.raises(PeerError, match=f"{path} is not the file of a peer; remove it, and pair again"):
            read()
    store.remove("robot")
    assert store.labels() == []
    put(store, GOOD)
    assert store.find("robot").key == bytes(32), "otherwise it would be good"


@pytest.mark.parametrize(
    ("name", "mode", "good"),
    [
        *(("robot.json", mode, 0o600) for mode in (0o604, 0o640, 0o620, 0o602)),
        *(("", mode, 0o700) for mode in (0o720, 0o702)),
    ],
)
def test_what_others_may_read_or_write_is_refused_with_the_remedy(
    store: PeerStore, name: str, mode: int, good: int
) -> None:
    store.add(ROBOT)
    path = store.folder / name
    path.chmod(mode)
    with pytest.raises(PeerError, match=f"chmod {good:o} {path}"):
        store.find("robot")
    path.chmod(good)
    assert store.find("robot") == ROBOT


def test_link_pipe_and_folder_are_no_peer(store: PeerStore, tmp_path: Path) -> None:
    store.add(ROBOT)
    (store.folder / "robot.json").rename(tmp_path / "elsewhere")
    (store.folder / "link.json").symlink_to(tmp_path / "elsewhere")
    (store.folder / "folder.json").mkdir()
    os.mkfifo(store.folder / "pipe.json", 0o600)
    for label in store.labels():
        with pytest.raises(PeerError, match=f"{label}.json (is a symbolic link|is not a file)"):
            store.find(label)
    assert len(store.labels()) == 3


@needs_root
def test_file_and_folder_of_another_user_are_refused(store: PeerStore) -> None:
    store.add(ROBOT)
    os.chown(store.folder / "robot.json", NOBODY, NOBODY)
    with pytest.raises(PeerError, match=r"robot\.json belongs to user id .* sudo chown"):
        store.find("robot")
    os.chown(store.folder, NOBODY, NOBODY)
    with pytest.raises(PeerError, match="peers belongs to another user"):
        store.labels()


@needs_root
def test_another_user_reads_nothing() -> None:
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        store = PeerStore(Path(folder) / "peers")
        store.add(ROBOT)
        assert as_stranger(read_file, store.folder / "robot.json") == "refused"
        assert as_stranger(list_labels, str(store.folder)) == f"{store.folder} cannot be read: Permission denied"


def list_labels(folder: str) -> str:
    try:
        return str(PeerStore(Path(folder)).labels())
    except PeerError as error:
        return str(error)


def test_of_many_at_once_one_adds(store: PeerStore) -> None:
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
