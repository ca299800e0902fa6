from collections.abc import Callable
from pathlib import Path

import pytest

from weberlink.protocol.keys import KeyFileError
from weberlink_anywhere.credentials import credentials, read_credentials, read_secret

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
