"""Marks that a person sets in a recording: messages of the schema rcl_interfaces/msg/Log, which ROS 2 tools show."""

from struct import Struct, error
from typing import NamedTuple

from weberlink.telemetry.message import ENCAPSULATION
from weberlink.text import one_line

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
LONGEST_MARK = 200  # characters of a mark; the rest is cut off

_HEAD = Struct("<iIB")
_LENGTH = Struct("<I")
_NS = 1_000_000_000


class Mark(NamedTuple):
    """A mark: its moment on the wall clock [ns since 1970], and its text."""

    wall_ns: int
    text: str


def pack_mark(mark: Mark) -> bytes:
    """The CDR body of a mark, without the encapsulation header."""
    seconds, nanoseconds = divmod(mark.wall_ns, _NS)
    body = bytearray(_HEAD.pack(seconds, nanoseconds, INFO))
    for text in (NAME, mark.text, "", ""):
        data = text.encode() + b"\0"
        body += bytes(-len(body) % _LENGTH.size) + _LENGTH.pack(len(data)) + data
    return bytes(body + bytes(-len(body) % _LENGTH.size) + _LENGTH.pack(0))


def read_mark(message: bytes) -> Mark:
    """Read a message with its encapsulation header; raises ValueError if it is none, or not plain CDR."""
    if message[:2] != ENCAPSULATION[:2]:
        raise ValueError("a mark that is not plain little-endian CDR")
    body = message[len(ENCAPSULATION) :]
    try:
        seconds, nanoseconds, _ = _HEAD.unpack_from(body)
        _, at = _string(body, _HEAD.size)
        text, _ = _string(body, at)
    except error:
        raise ValueError("a mark that is cut short") from None
    return Mark(seconds * _NS + nanoseconds, text)


def shortened(text: str) -> str:
    """A text of one line that fits a mark; "mark" if nothing is left of it."""
    return one_line(text, LONGEST_MARK) or "mark"


def _string(body: bytes, at: int) -> tuple[str, int]:
    """The string at a place, and where it ends."""
    at += -at % _LENGTH.size
    (length,) = _LENGTH.unpack_from(body, at)
    end = at + _LENGTH.size + length
    if length == 0 or end > len(body):
        raise ValueError("a mark that is cut short")
    return body[at + _LENGTH.size : end - 1].decode(errors="replace"), end
