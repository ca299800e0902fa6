from pathlib import Path

import pytest

from weberlink.anywhere.credentials import credentials, read_credentials, read_secret
from weberlink.protocol.keys import KeyFileError

SECRET = "north-star-of-the-relay"


def private_file(folder: Path, content: str) -> Path:
    path = folder / "turn.secret"
    path.write_text(content)
    path.chmod(0o600)
    return path


def test_password_is_hmac_of_expiry_and_name() -> None:
    # printf 1000000600:op | openssl dgst -sha1 -hmac north-star-of-the-relay -binary | base64
    assert credentials(SECRET, "op", 1e9, 600.0) == ("1000000600:op", "eu05EBFpQGhiMsHYObQnILIDjUk=")


def test_secret_is_the_word_in_the_file(tmp_path: Path) -> None:
    assert read_secret(private_file(tmp_path, f"{SECRET}\n")) == SECRET


def test_credentials_are_both_words_in_the_file(tmp_path: Path) -> None:
    assert read_credentials(private_file(tmp_path, "name password\n")) == ("name", "password")


def test_secret_open_to_others_is_refused_with_remedy(tmp_path: Path) -> None:
    path = private_file(tmp_path, SECRET)
    path.chmod(0o640)
    with pytest.raises(KeyFileError, match=f"chmod 600 {path}"):
        read_secret(path)


def test_missing_secret_says_what_belongs_there(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="does not exist; write into it the secret of the relay"):
        read_secret(tmp_path / "turn.secret")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "something else"),
        ("two words", "something else"),
        ("s\u00e4cret-of-the-relay", "something else"),
        ("short", "this one 5"),
    ],
)
def test_other_contents_are_no_secret(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(KeyFileError, match=message):
        read_secret(private_file(tmp_path, content))


def test_one_word_is_no_credentials(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="user name and password"):
        read_credentials(private_file(tmp_path, "name"))
