"""Marks that a person sets in a recording: messages of the schema rcl_interfaces/msg/Log, which ROS 2 tools show."""

from struct import Struct, error
from typing import NamedTuple

from weberlink.text import one_line
from weberlink_figures.message import ENCAPSULATION

MARK_TOPIC, JOURNAL_TOPIC = "/weberlink/marks", "/weberlink/journal"
"""Of marks, and of the lines of the journal (`weberlink_figures.chain`), which are messages of the same schema."""
MARK_SCHEMA = "rcl_interfaces/msg/Log"
MARK_DEFINITION = """\
# A mark that a person has set in a recording of a WeberLink session.
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
NAME = "weberlink"
INFO = 20  # the level INFO of the schema
NS = 1_000_000_000
_LENGTH = Struct("<I")
LONGEST_MARK = 200  # characters of a mark; the rest is cut off

_HEAD = Struct("<iIB")  # stamp, level


class Mark(NamedTuple):
    """A mark: its moment on the wall clock [ns since 1970], and its text."""

    wall_ns: int
    text: str


def pack_mark(mark: Mark) -> bytes:
    """The CDR body of a mark, without the encapsulation header."""
    head = _HEAD.pack(*divmod(mark.wall_ns, NS), INFO)
    return pack_cdr(head, *(text.encode() + b"\0" for text in (NAME, mark.text, "", "")), b"")  # ends with line 0


def read_mark(message: bytes) -> Mark:
    """Read a message with its encapsulation header; raises ValueError if it is none, or not plain CDR."""
    wall_ns, (_, text) = read_cdr(message, _HEAD, 2, "mark")
    return Mark(wall_ns, text[:-1].decode(errors="replace"))


def shortened(text: str) -> str:
    """A text of one line that fits a mark; "mark" if nothing is left of it."""
    return one_line(text, LONGEST_MARK) or "mark"


def pack_cdr(head: bytes, *parts: bytes) -> bytes:
    """A CDR body without the encapsulation header: numbers, then strings or sequences of bytes behind their lengths."""
    body = bytearray(head)
    for data in parts:
        body += bytes(-len(body) % _LENGTH.size) + _LENGTH.pack(len(data)) + data
    return bytes(body)


def read_cdr(message: bytes, head: Struct, count: int, what: str) -> tuple[int, list[bytes]]:
    """The time stamp with which a message begins [ns since 1970], and the first parts behind its numbers; raises
    ValueError if it is cut short, or not plain CDR.
    """
    body, at, parts = message[len(ENCAPSULATION) :], head.size, []
    try:
        seconds, nanoseconds, *_ = head.unpack_from(body)
        for _ in range(count):
            at += -at % _LENGTH.size
            (length,) = _LENGTH.unpack_from(body, at)
            at += _LENGTH.size + length
            parts.append(body[at - length : at])
    except error:
        raise ValueError(f"a {what} that is cut short") from None
    if message[:2] != ENCAPSULATION[:2] or at > len(body):
        raise ValueError(f"a {what} that is cut short, or not plain little-endian CDR")
    return seconds * NS + nanoseconds, parts
