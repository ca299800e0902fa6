"""A chain of lines: each holds a hash of itself and of all before it, so that none is changed or taken out alone.

A line is a JSON object whose last member is `"chain"`: SHA-256 in hexadecimal over the hash of the line before it and
the text of the line without this member. Who rewrites every line from one on leaves no trace but another last hash.
"""

import json
import re
from collections.abc import Iterable, Mapping
from hashlib import sha256
from typing import Any, NamedTuple

START = "0" * 64  # the hash before the first line of a session
_LINE = re.compile(rb'(\{.*),"chain":"([0-9a-f]{64})"\}', re.DOTALL)


class Chain:
    """The lines of one session; `head` is the hash of the newest that was written."""

    def __init__(self) -> None:
        self.head = START

    def line(self, document: Mapping[str, Any]) -> str:
        """The next line; ValueError for a number that is not finite. `append` it once it is written."""
        text = json.dumps(document, separators=(",", ":"), allow_nan=False)
        return f'{text[:-1]},"chain":"{line_hash(self.head, text.encode()[:-1])}"}}'

    def append(self, line: str) -> None:
        self.head = line[-66:-2]


def line_hash(before: str, text: bytes) -> str:
    """Of a line without its last member and brace, after the one with the hash `before`."""
    return sha256(before.encode() + text).hexdigest()


class Verified(NamedTuple):
    """What a chain of lines says of itself: lines and sessions, the last hash, and the first line that does not follow
    on the one before it; 0 for none."""

    lines: int
    sessions: int
    head: str
    broken: int

    def __str__(self) -> str:
        if self.broken:
            return f"changed at line {self.broken}: it does not follow on what is before it"
        sessions = f"{self.sessions} sessions" if self.sessions != 1 else "1 session"
        return f"{self.lines} lines of {sessions}, unchanged; its last hash is {self.head}"


def verify(lines: Iterable[bytes]) -> Verified:
    """Follow the chain of some lines, without their ends, up to the first that does not follow."""
    number, sessions, head = 0, 0, START
    for number, line in enumerate(lines, 1):
        found = _LINE.fullmatch(line)
        text, told = (b"", "") if found is None else (found[1], found[2].decode())
        if told == line_hash(START, text):
            sessions += 1
        elif not sessions or told != line_hash(head, text):
            return Verified(number - 1, sessions, head, number)
        head = told
    return Verified(number, sessions, head, 0)
