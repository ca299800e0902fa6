"""The directory of a user in memory, with others in the way: a folder stands for /dev/shm, open to all as that is."""

import os
import socket
import tempfile
from pathlib import Path
from time import monotonic

import pytest

from tests.strangers import (
    NOBODY,
    as_stranger,
    needs_root,
    read_file,
    squat_directory,
    squat_fifo,
    squat_file,
    squat_large,
    squat_link,
)
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import LARGEST_FILE, RingWriter
from weberlink.telemetry.runtime_directory import ForeignFileError, Places, RuntimeDirectoryError, open_file

ME = os.geteuid()


@pytest.fixture
def shared():
    """A directory in which everybody may make files, with the sticky bit."""
    with tempfile.TemporaryDirectory(prefix="everybody-") as folder:
        Path(folder).chmod(0o1777)
        yield Path(folder)


@pytest.fixture
def places(shared):
    return Places({}, shared / "no login", shared)


def mounts(folder: Path, path: Path, kind: str) -> Path:
    """A table of mounts in which a path lies on a file system of this kind."""
    device = path.stat().st_dev
    table = folder / "mountinfo"
    table.write_text(f"30 1 {os.major(device)}:{os.minor(device)} / / rw shared:1 - {kind} none rw\n")
    return table


def test_it_is_made_once_and_for_this_user_alone(places, shared):
    assert places.directories() == []
    first = places.directory()
    assert first == shared / f"weberlink-{ME}"
    assert first.stat().st_mode & 0o777 == 0o700
    assert places.directory() == first
    assert places.directories() == [first]


@pytest.mark.parametrize(("kind", "expected"), [("tmpfs", "login/weberlink"), ("ext4", f"weberlink-{ME}")])
def test_that_of_the_login_is_taken_if_it_is_in_memory(shared, tmp_path, kind, expected):
    login = shared / "login"
    login.mkdir(0o700)
    table = mounts(tmp_path, login, kind)
    assert Places({"XDG_RUNTIME_DIR": str(login)}, shared, shared, table).directory() == shared / expected


@pytest.mark.parametrize("mode", [0o755, 0o770, 0o701])
def test_one_that_others_can_enter_is_refused_with_the_line_that_helps(places, shared, mode):
    path = shared / f"weberlink-{ME}"
    path.mkdir()
    path.chmod(mode)
    with pytest.raises(RuntimeDirectoryError, match=f"chmod 700 {path}"):
        places.directory()
    assert places.directories() == []


def test_without_any_memory_it_is_said_what_to_do(tmp_path):
    with pytest.raises(RuntimeDirectoryError, match=r"mount a tmpfs at .*XDG_RUNTIME_DIR"):
        Places({}, tmp_path, tmp_path / "missing").directory()


@needs_root
@pytest.mark.parametrize(
    ("attack", "more"),
    [(squat_directory, ()), (squat_file, ()), (squat_fifo, ()), (squat_link, ("/tmp",)), (squat_directory, (0o700,))],
)
def test_a_name_that_another_user_took_keeps_nobody_from_starting(places, shared, attack, more):
    as_stranger(attack, shared / f"weberlink-{ME}", *more)
    as_stranger(squat_directory, shared / f"weberlink-{ME}.guessed")
    began = monotonic()
    mine = places.directory()
    assert monotonic() - began < 1.0
    status = mine.lstat()
    assert (status.st_uid, status.st_mode & 0o777) == (ME, 0o700)
    assert places.directory() == mine
    assert places.directories() == [mine]


@needs_root
def test_no_other_user_reads_or_makes_anything_in_it(places):
    mine = places.directory()
    (mine / "secret").write_text("mine")
    assert as_stranger(read_file, mine / "secret") == "refused"
    for attack in (squat_file, squat_fifo, squat_directory):
        assert as_stranger(attack, mine / "weberlink-1-master.ring") == "refused"


def test_only_a_small_regular_file_is_opened(shared):
    plain, link, fifo, door = (shared / name for name in ("plain", "link", "fifo", "door"))
    plain.write_bytes(bytes(100))
    link.symlink_to(plain)
    os.mkfifo(fifo)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(door))
        os.close(open_file(plain, 100))
        with pytest.raises(ForeignFileError, match="100 bytes, more than 99"):
            open_file(plain, 99)
        for path, what in ((link, "symbolic link"), (fifo, "a FIFO, not a file"), (shared, "a directory, not a file")):
            with pytest.raises(ForeignFileError, match=what):
                open_file(path, 100)
        with pytest.raises(OSError, match="door"):
            open_file(door, 100)


@needs_root
@pytest.mark.parametrize("attack", [squat_file, squat_fifo, squat_large])
def test_a_ring_of_another_user_is_neither_read_nor_replaced(shared, attack):
    path = shared / "weberlink-7-master.ring"
    as_stranger(attack, path)
    with RingWriter(shared / "right", side="master", rate_hz=1000.0, capacity=4) as ring:
        as_stranger(squat_file, shared / "forged", ring.path.read_bytes())
    with pytest.raises(ForeignFileError, match="belongs to"):
        RingReader(shared / "forged")
    for use in (lambda: RingReader(path), lambda: RingWriter(path, side="x", rate_hz=1.0, capacity=2)):
        began = monotonic()
        with pytest.raises(ForeignFileError):
            use()
        assert monotonic() - began < 1.0
    assert path.lstat().st_uid == NOBODY


def test_a_ring_that_claims_more_than_it_may_is_refused(shared):
    path = shared / "large.ring"
    RingWriter(path, side="master", rate_hz=1000.0, capacity=4).close(unlink=False)
    with path.open("r+b") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(ForeignFileError, match="more than"):
        RingReader(path)
