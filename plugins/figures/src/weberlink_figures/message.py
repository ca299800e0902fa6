"""The ROS 2 message of a telemetry record, and the channel of a side in a recording.

The message definition follows from the table of fields. As the table puts wide types first, a packed record is a CDR
body as it stands: it lacks only the encapsulation header.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.record import FIELDS, Field

SCHEMA_NAME = "weberlink_msgs/msg/Tick"
SCHEMA_ENCODING = "ros2msg"
MESSAGE_ENCODING = "cdr"

ENCAPSULATION = b"\x00\x01\x00\x00"
"""What every message begins with: plain CDR, little endian, no options (DDSI-RTPS 2.x, section 10)."""

Rows = NDArray[np.void]

CODES = {"float64": "<f8", "float32": "<f4", "uint64": "<u8", "uint32": "<u4", "int32": "<i4", "uint8": "u1"}
"""Numpy's formats of the numbers of ROS."""
_TYPES = {code: kind for kind, code in CODES.items()}


def _line(field: Field) -> str:
    kind = _TYPES[field.kind]
    if field.axes > 1:
        kind = f"{kind}[{field.axes}]"
    unit = f"[{field.unit}] " if field.unit else ""
    return f"{kind} {field.name}  # {unit}{field.meaning}"


SCHEMA_TEXT = "\n".join(["# One tick of one side of a WeberLink session.", *map(_line, FIELDS), ""])


def fields_in(definition: str) -> Iterator[tuple[str, str]]:
    """Type and name of each field of the first definition in a text; a constant is none. Raises ValueError if a line is
    no field.
    """
    for line in definition.partition("===")[0].splitlines():
        told = line.partition("#")[0].strip()
        if told and "=" not in told:
            kind, _, rest = told.partition(" ")
            if not rest:
                raise ValueError(f"{told!r} is no field")
            yield kind, rest.split()[0]


@cache  # live messages are made some hundred times a second, a few at a time
def aligned(columns: tuple[tuple[str, Any, int], ...]) -> np.dtype[np.void]:
    """The layout of a message body as CDR has it: each column of a name, a format and a boundary on its boundary."""
    offsets, end = [], 0
    for _, code, boundary in columns:
        offsets.append(-(-end // boundary) * boundary)
        end = offsets[-1] + np.dtype(code).itemsize
    names, formats, _ = zip(*columns, strict=True)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": end})


TOPICS = {"master": "/weberlink/master", "slave": "/weberlink/slave"}
SIDES = {topic: side for side, topic in TOPICS.items()}

_FARTHEST_NS = 9e18  # from 1970 to the end of 64-bit nanoseconds with a sign


@dataclass(frozen=True)
class Origin:
    """One side of a recording."""

    side: str  # "master" or "slave"
    rate_hz: float  # of the ticks [Hz]
    wall_s: float  # a moment on the wall clock [s since 1970]
    monotonic_s: float  # the same moment on the clock of the records [s]

    @property
    def topic(self) -> str:
        """Raises ValueError for a side that does not exist."""
        if self.side not in TOPICS:
            raise ValueError(f"side must be one of {', '.join(TOPICS)}, got {self.side!r}")
        return TOPICS[self.side]

    def log_times_ns(self, at: NDArray[np.float64]) -> NDArray[np.uint64]:
        """The wall clock at moments on the clock of the records [ns since 1970]; NaN is taken for the origin."""
        wall_ns = round(self.wall_s * 1e9)
        with np.errstate(over="ignore"):
            since_ns = np.nan_to_num((at - self.monotonic_s) * 1e9, nan=0.0)
        since_ns = np.clip(since_ns, -wall_ns, _FARTHEST_NS - wall_ns)
        return (wall_ns + np.rint(since_ns).astype(np.int64)).astype(np.uint64)
