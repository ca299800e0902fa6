"""What the messages of an open connection say, and their bytes. Pure; everything that is read has a bound.

| kind | from | payload |
|---|---|---|
| READY | looking | nothing: the caller holds the fresh keys |
| ALIVE | both | nothing |
| BEGIN | sharing | zlib, JSON: session, side, rate_hz, began, description |
| RECORDS | sharing | side u8, written u64, lost u64, zlib of records; little endian |
| END | sharing | side u8: nothing more will come of it |
"""

import json
import zlib
from enum import IntEnum
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from weberlink.apps.monitor.remote.channel import LONGEST_PAYLOAD, StreamError
from weberlink.system.bounded_json import parse
from weberlink.system.configuration import SIDES
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import RECORD

RECORDS_AT_ONCE = 160
"""Packs into a message whatever they hold."""
LONGEST_BEGIN = 1_000_000
"""Of a side's introduction, unpacked."""
_LEVEL = 1
_RECORDS_HEAD = Struct("<BQQ")


class Message(IntEnum):
    """Kinds of message."""

    READY = 1
    ALIVE = 2
    BEGIN = 3
    RECORDS = 4
    END = 5


class Begin(NamedTuple):
    """A side is about to be sent; `began` is when its writer began, on the clock of its records [s]."""

    session: str
    side: str
    rate_hz: float
    began: float
    description: dict[str, Any] | None


class Piece(NamedTuple):
    """Records of a side, and how many it has written and the sender has missed so far."""

    side: str
    written: int
    lost: int
    records: Records


def pack_begin(begin: Begin) -> bytes:
    """An introduction; without the description where that is too long to be sent."""
    packed = _packed(begin)
    return packed if len(packed) <= LONGEST_PAYLOAD else _packed(begin._replace(description=None))


def read_begin(payload: bytes) -> Begin:
    """Raises StreamError where a field is missing, or of another type, or out of range."""
    data = _inflated(payload, LONGEST_BEGIN)
    try:
        begin = Begin(**parse(data, LONGEST_BEGIN))
    except (ValueError, TypeError) as error:
        raise StreamError(f"an introduction cannot be read ({type(error).__name__})") from None
    if (
        not isinstance(begin.session, str)
        or begin.side not in SIDES
        or not (_is_number(begin.rate_hz) and 1.0 <= begin.rate_hz <= 100_000.0)
        or not (_is_number(begin.began) and abs(begin.began) < 1e10)
        or not isinstance(begin.description, dict | None)
    ):
        raise StreamError("an introduction says nothing plausible")
    return begin


def pack_records(piece: Piece) -> bytes:
    """At most `RECORDS_AT_ONCE` records."""
    head = _RECORDS_HEAD.pack(SIDES.index(piece.side), piece.written, piece.lost)
    return head + zlib.compress(piece.records.tobytes(), _LEVEL)


def read_records(payload: bytes) -> Piece:
    """Raises StreamError for what is no records."""
    if len(payload) < _RECORDS_HEAD.size:
        raise StreamError("records are cut short")
    side, written, lost = _RECORDS_HEAD.unpack_from(payload)
    data = _inflated(payload[_RECORDS_HEAD.size :], RECORDS_AT_ONCE * RECORD.size)
    if side >= len(SIDES) or len(data) % RECORD.size:
        raise StreamError("records are of an unknown kind")
    return Piece(SIDES[side], written, lost, np.frombuffer(data, DTYPE))


def pack_end(side: str) -> bytes:
    return bytes((SIDES.index(side),))


def read_end(payload: bytes) -> str:
    """Raises StreamError for an unknown side."""
    if len(payload) != 1 or payload[0] >= len(SIDES):
        raise StreamError("the end of an unknown side")
    return SIDES[payload[0]]


def _packed(begin: Begin) -> bytes:
    return zlib.compress(json.dumps(begin._asdict()).encode(), 9)


def _inflated(data: bytes, most: int) -> bytes:
    """Unpacked bytes, of which there may be so many."""
    inflater = zlib.decompressobj()
    try:
        unpacked = inflater.decompress(data, most)
    except zlib.error:
        raise StreamError("a message cannot be unpacked") from None
    if not inflater.eof:
        raise StreamError("a message is longer than is agreed")
    return unpacked


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value == value  # noqa: PLR0124 - not NaN
