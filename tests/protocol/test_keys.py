import os
from pathlib import Path

import pytest

from tests.strangers import NOBODY, needs_root
from weberlink.protocol.keys import KEY_BYTES, HeldKey, KeyFileError, Right, generate, load


def test_a_generated_key_is_its_owners_only_and_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "link.key"
    generate(path)
    ((key, right, name),) = load(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(key) == KEY_BYTES and right is Right.DRIVE and name == ""
    with pytest.raises(KeyFileError, match="exists already"):
        generate(path)
    assert load(path) == (HeldKey(key),)
    with pytest.raises(KeyFileError, match="cannot be written"):
        generate(tmp_path / "missing" / "link.key")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o644, 0o666])
def test_key_file_open_to_others_is_refused_with_the_remedy(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "link.key"
    generate(path)
    path.chmod(mode)
    with pytest.raises(KeyFileError, match=f"chmod 600 {path}"):
        load(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not a key file"),
        (b"hello", "not a key file"),
        (b"weberlink-key-1 xyz", "not a key file"),
        (b"\xff\xfe" * 40, "not a key file"),
        (b"weberlink-key-1 " + b"ab" * 31, "31 bytes"),
        (b"weberlink-key-1 " + b"ab" * 33, "33 bytes"),
        (b"weberlink-key-9 " + b"ab" * 32, "weberlink-key-9"),
        (b"x" * 100_000, "not a key file"),
        (b"weberlink-key-1 " + b"ab" * 32 + b" rule ann", "a key may drive, watch, stop, not 'rule'"),
        (b"weberlink-key-1 " + b"ab" * 32 + b" stop", "needs the name of the host"),
        (b"weberlink-key-1 " + b"ab" * 32 + b" stop a\x1b[2J", "printable"),
        (b"weberlink-key-1 " + b"ab" * 32 + b" drive " + b"n" * 65, "64 printable"),
        ((b"weberlink-key-1 " + b"ab" * 32 + b"\n") * 2, "two keys without a name"),
        ((b"weberlink-key-1 " + b"ab" * 32 + b" stop pedal\n") * 2, "two keys for 'pedal'"),
        (b"weberlink-key-1 " + b"ab" * 32 + b"\nhello", "not a key file"),
    ],
)
def test_other_contents_are_no_key(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "link.key"
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(KeyFileError, match=message):
        load(path)


def test_a_file_of_the_robots_end_holds_the_keys_of_several_hosts(tmp_path: Path) -> None:
    """Made one by one, and put together as a user does it."""
    paths = [tmp_path / right for right in Right]
    for right, path in zip(Right, paths, strict=True):
        generate(path, right, f"{right} ing@desk")
    generate(tmp_path / "any")
    book = tmp_path / "book"
    book.write_text("\n".join(path.read_text() for path in [*paths, tmp_path / "any"]))
    book.chmod(0o600)
    held = load(book)
    assert [(key.right, key.name) for key in held] == [*((r, f"{r} ing@desk") for r in Right), (Right.DRIVE, "")]
    assert (
        held[:-1] == tuple(key for path in paths for key in load(path)) and len({key.grant.number for key in held}) == 4
    )
    with pytest.raises(KeyFileError, match="needs the name of the host"):
        generate(tmp_path / "nameless", Right.STOP)


def test_what_is_no_file_is_no_key_and_is_not_waited_for(tmp_path: Path) -> None:
    generate(tmp_path / "key")
    (tmp_path / "link").symlink_to(tmp_path / "key")
    os.mkfifo(tmp_path / "pipe", 0o600)
    (tmp_path / "folder").mkdir()
    for name, message in (
        ("link", "link is a symbolic link; name the file itself"),
        ("pipe", "not a file"),
        ("folder", "not a file"),
        ("missing", "weberlink keygen"),
    ):
        with pytest.raises(KeyFileError, match=message):
            load(tmp_path / name)


@needs_root
def test_a_key_of_another_user_is_no_key(tmp_path: Path) -> None:
    path = tmp_path / "key"
    generate(path)
    os.chown(path, NOBODY, NOBODY)
    with pytest.raises(KeyFileError, match=f"belongs to user id {NOBODY}.* sudo chown 0 {path}"):
        load(path)
