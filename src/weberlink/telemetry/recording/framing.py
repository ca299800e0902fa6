"""How MCAP frames what it holds: opcode, length, content; and the frame of one message of fixed size as a numpy type.

Owns no file and no meaning. A chunk of messages of one size is one array, which is why neither writing nor reading one
costs Python a step per message.
"""

from collections.abc import Iterator
from functools import cache
from struct import Struct

import numpy as np
from mcap.opcode import Opcode

from weberlink.telemetry.recording.message import ENCAPSULATION, Rows

MAGIC = b"\x89MCAP0\r\n"
"""Begins a file and ends a complete one."""
FRAME = Struct("<BQ")
MESSAGE = Struct("<HIQQ")
"""What a message begins with: channel, sequence, log time, publish time [ns]."""
HEAD = FRAME.size + MESSAGE.size + len(ENCAPSULATION)


@cache
def rows_of(body: int) -> np.dtype[np.void]:
    """The frame of a message whose record has `body` bytes, the record itself as raw bytes."""
    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("encapsulation", f"V{len(ENCAPSULATION)}"),
            ("body", f"V{body}"),
        ]
    )


def frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each frame that is whole; what is left at the end is dropped."""
    at, size = 0, len(data)
    while at + FRAME.size <= size:
        opcode, length = FRAME.unpack_from(data, at)
        at += FRAME.size
        if length > size - at:
            return
        yield opcode, data[at : at + length]
        at += length


def uniform(data: bytes) -> Rows | None:
    """All of a chunk as rows, if it holds nothing but messages of one size; else None."""
    if len(data) < HEAD:
        return None
    opcode, length = FRAME.unpack_from(data)
    size = FRAME.size + length
    if opcode != Opcode.MESSAGE or size <= HEAD or len(data) % size:
        return None
    # One row after the other is where the first says, so that this holds of all or of none.
    rows: Rows = np.frombuffer(data, rows_of(size - HEAD))
    same = (rows["opcode"] == Opcode.MESSAGE).all() and (rows["length"] == length).all()
    return rows if same else None
