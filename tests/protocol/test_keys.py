import os
from pathlib import Path

import pytest

from tests.strangers import NOBODY, needs_root
from weberlink.protocol.keys import KEY_BYTES, KeyFileError, generate, load


def test_generated_key_is_readable_by_its_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "link.key"
    generate(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(load(path)) == KEY_BYTES


def test_a_key_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "link.key"
    generate(path)
    key = load(path)
    with pytest.raises(KeyFileError, match="exists already"):
        generate(path)
    assert load(path) == key


def test_no_key_where_none_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="cannot be written"):
        generate(tmp_path / "missing" / "link.key")


def test_a_missing_file_names_the_command(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="weberlink keygen"):
        load(tmp_path / "link.key")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o644, 0o666])
def test_key_file_open_to_others_is_refused_with_the_remedy(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "link.key"
    generate(path)
    path.chmod(mode)
    with pytest.raises(KeyFileError, match=f"chmod 600 {path}"):
        load(path)


def test_a_directory_is_no_key(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="not a file"):
        load(tmp_path)


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
    ],
)
def test_other_contents_are_no_key(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "link.key"
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(KeyFileError, match=message):
        load(path)


def test_a_link_to_a_key_is_no_key(tmp_path: Path) -> None:
    generate(tmp_path / "key")
    (tmp_path / "link").symlink_to(tmp_path / "key")
    with pytest.raises(KeyFileError, match="link is a symbolic link; name the file itself"):
        load(tmp_path / "link")


@needs_root
def test_a_key_of_another_user_is_no_key(tmp_path: Path) -> None:
    path = tmp_path / "key"
    generate(path)
    os.chown(path, NOBODY, NOBODY)
    with pytest.raises(KeyFileError, match=f"belongs to user id {NOBODY}.* sudo chown 0 {path}"):
        load(path)


def test_a_pipe_is_no_key_and_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "key", 0o600)
    with pytest.raises(KeyFileError, match="not a file"):
        load(tmp_path / "key")
