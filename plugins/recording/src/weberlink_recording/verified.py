"""Whether the lines of a journal are those that were written (`weberlink_figures.chain`)."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from weberlink_figures.chain import START, line_hash

_LINE = re.compile(rb'(\{.*),"chain":"([0-9a-f]{64})"\}', re.DOTALL)


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
