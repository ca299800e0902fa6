"""Messages of the telemetry link and their encoding; the size of everything read is limited.

| kind | from | payload |
|---|---|---|
| READY | looking | empty: the caller holds the fresh keys |
| ALIVE | both | empty |
| BEGIN | sharing | zlib, JSON: session, side, rate_hz, began, description |
| RECORDS | sharing | side u8, written u64, lost u64, zlib of records; little endian |
| END | sharing | side u8: its last records were sent |
"""

import json
import zlib
from enum import IntEnum
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from weberlink.protocol.sealed_stream import LONGEST_PAYLOAD, StreamError
from weberlink.system.bounded_json import parse
from weberlink.system.configuration import SIDES
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import RECORD

RECORDS_AT_ONCE = 95
"""Most records of a message: they fit whatever they hold."""
LONGEST_BEGIN = 1_000_000
"""Longest introduction, unpacked [bytes]."""
_LEVEL = 1
_RECORDS_HEAD = Struct("<BQQ")


class LinkMessage(IntEnum):
    """Kinds of message."""

    READY = 1
    ALIVE = 2
    BEGIN = 3
    RECORDS = 4
    END = 5


class SideIntroduction(NamedTuple):
    """Precedes the records of a side; `began` is when its writer began, on the clock of its records [s]."""

    session: str
    side: str
    rate_hz: float
    began: float
    description: dict[str, Any] | None


class RecordBlock(NamedTuple):
    """Records of a side, and how many it wrote and the sender missed so far."""

    side: str
    written: int
    lost: int
    records: Records


def pack_introduction(introduction: SideIntroduction) -> bytes:
    """Pack an introduction, without the description if that is too long."""
    packed = _packed(introduction)
    return packed if len(packed) <= LONGEST_PAYLOAD else _packed(introduction._replace(description=None))


def read_introduction(payload: bytes) -> SideIntroduction:
    """Raises StreamError if a field is missing, of a wrong type or out of range."""
    data = _inflated(payload, LONGEST_BEGIN)
    try:
        introduction = SideIntroduction(**parse(data, LONGEST_BEGIN))
    except (ValueError, TypeError) as error:
        raise StreamError(f"an introduction cannot be read ({type(error).__name__})") from None
    if (
        not isinstance(introduction.session, str)
        or introduction.side not in SIDES
        or not (_is_number(introduction.rate_hz) and 1.0 <= introduction.rate_hz <= 100_000.0)
        or not (_is_number(introduction.began) and abs(introduction.began) < 1e10)
        or not isinstance(introduction.description, dict | None)
    ):
        raise StreamError("an introduction has values out of range")
    return introduction


def pack_records(block: RecordBlock) -> bytes:
    """At most `RECORDS_AT_ONCE` records."""
    head = _RECORDS_HEAD.pack(SIDES.index(block.side), block.written, block.lost)
    return head + zlib.compress(block.records.tobytes(), _LEVEL)


def read_records(payload: bytes) -> RecordBlock:
    """Raises StreamError if these are no records."""
    if len(payload) < _RECORDS_HEAD.size:
        raise StreamError("records are cut short")
    side, written, lost = _RECORDS_HEAD.unpack_from(payload)
    data = _inflated(payload[_RECORDS_HEAD.size :], RECORDS_AT_ONCE * RECORD.size)
    if side >= len(SIDES) or len(data) % RECORD.size:
        raise StreamError("records are of an unknown kind")
    return RecordBlock(SIDES[side], written, lost, np.frombuffer(data, DTYPE))


def pack_end(side: str) -> bytes:
    return bytes((SIDES.index(side),))


def read_end(payload: bytes) -> str:
    """Raises StreamError for an unknown side."""
    if len(payload) != 1 or payload[0] >= len(SIDES):
        raise StreamError("the end of an unknown side")
    return SIDES[payload[0]]


def _packed(introduction: SideIntroduction) -> bytes:
    return zlib.compress(json.dumps(introduction._asdict()).encode(), 9)


def _inflated(data: bytes, most: int) -> bytes:
    """Decompress to at most `most` bytes."""
    inflater = zlib.decompressobj()
    try:
        unpacked = inflater.decompress(data, most)
    except zlib.error:
        raise StreamError("a message cannot be unpacked") from None
    if not inflater.eof:
        raise StreamError("a message is longer than allowed")
    return unpacked


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value == value  # noqa: PLR0124 - not NaN
