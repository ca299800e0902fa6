"""Attacks by another user of the same host, each in a process of its own under another user id.

    @needs_root
    def test_...():
        as_stranger(squat_file, path)

Each attack takes plain arguments and returns what it got, as JSON. `PermissionError` is an answer: `refused`.
"""

import encodings.idna  # noqa: F401 - the other user may not be permitted to read the libraries of Python
import json
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

NOBODY = 65534  # another user than the one of the tests

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as another user")

Attack = Callable[..., Any]


def as_stranger(attack: Attack, *arguments: Any) -> Any:
    """Run an attack as another user; returns what it got, or "refused" where it had no permission."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        _become(writing, attack, arguments)
    os.close(writing)
    with os.fdopen(reading, "rb") as answer:
        told = answer.read()
    os.waitpid(pid, 0)
    document = json.loads(told) if told else {"error": "the attack ended without an answer"}
    if "error" in document:
        raise RuntimeError(document["error"])
    return document["got"]


def _become(writing: int, attack: Attack, arguments: tuple[Any, ...]) -> None:
    """The whole life of the other process."""
    try:
        os.setgroups([])
        os.setresgid(NOBODY, NOBODY, NOBODY)
        os.setresuid(NOBODY, NOBODY, NOBODY)
        try:
            held = attack(*arguments)
        except PermissionError:
            held = "refused"
        got = held if isinstance(held, str | int | bool | list | None) else None
        os.write(writing, json.dumps({"got": got}).encode())
        os.close(writing)
    except BaseException as error:
        with suppress(OSError):
            os.write(writing, json.dumps({"error": repr(error)}).encode())
    finally:
        os._exit(0)


def squat_directory(path: str | Path, mode: int = 0o777) -> None:
    """Take a name with a directory that is open to all."""
    Path(path).mkdir()
    Path(path).chmod(mode)


def squat_file(path: str | Path, content: bytes = b"") -> None:
    """Take a name with a file that all may write."""
    Path(path).write_bytes(content)
    Path(path).chmod(0o666)


def squat_fifo(path: str | Path) -> None:
    """Take a name with a FIFO: whoever opens it for reading waits for a writer."""
    os.mkfifo(path)
    Path(path).chmod(0o666)


def squat_link(path: str | Path, target: str | Path) -> None:
    """Take a name with a symbolic link."""
    Path(path).symlink_to(target)


def squat_large(path: str | Path) -> None:
    """Take a name with a file that claims to be large and takes no room."""
    with Path(path).open("wb") as file:
        file.truncate(2**30)
    Path(path).chmod(0o666)


def read_file(path: str | Path) -> int:
    """Read what belongs to another: how many bytes."""
    return len(Path(path).read_bytes())


def ask_socket(path: str | Path, question: bytes) -> None:
    """Send a question to a socket of another user."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as connection:
        connection.sendto(question, str(path))
