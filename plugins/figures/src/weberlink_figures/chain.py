"""A chain of lines: each holds a hash of itself and of all before it, so that none is changed or taken out alone.

A line is a JSON object whose last member is `"chain"`: SHA-256 in hexadecimal over the hash of the line before it and
the text of the line without this member. Who rewrites every line from one on leaves no trace but another last hash.
"""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

START = "0" * 64  # the hash before the first line of a session


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
