"""The telemetry record of one tick of one side: one table of fields, and what follows from it.

A side has one stream or two: a hand's translation and rotation, or the joints of an arm and its gripper. The vectors of
a record have the axes of both, one after the other. What else is told of the second stream has names of its own.

A side fills the fields by name in a `weberlink.telemetry.row.Row`, and writes the axes and the streams that it has.
Readers see all of `MOST_AXES` and `STREAMS`, with 0 where nobody fills them.
"""

from collections.abc import Callable
from functools import cache
from math import nan
from struct import Struct
from typing import Any, NamedTuple

from weberlink.geometry.joints import MOST_JOINTS

AXES, TURNS = ("x", "y", "z"), ("rotation_x", "rotation_y", "rotation_z")
FORCE, TORQUE = slice(0, 3), slice(3, 6)  # places of what concerns the translation and the rotation of a hand
MOST_AXES = MOST_JOINTS + 1
STREAMS = 2
SECOND = "second_"  # begins the names of the fields of the second stream
UNKNOWN = (nan, nan, nan)  # a vector that is not known

RELEASED = 2  # value of `ramping` while the operator does not hold the button that lets the robot follow

MOST_RECEIVED = 255  # largest value of `received`: a peer may send any number of updates between two ticks

# numpy's names of the types (little endian) beside those of struct.
CODES = {"<f8": "d", "<f4": "f", "<u8": "Q", "u1": "B"}


class Field(NamedTuple):
    """One quantity of a record."""

    name: str
    kind: str  # numpy's name of its type
    axes: int  # 1 for a number, 3 for a vector in space, and `MOST_AXES` for one of all axes
    unit: str
    meaning: str


# Wide types come first, however many axes and streams are recorded: so every value of a packed record is aligned.
_F8, _U8, _F4, _U1 = "<f8", "<u8", "<f4", "u1"
FIELDS = (
    Field("at", _F8, 1, "s", "deadline of the tick, monotonic clock of this host"),
    Field("peer_at", _F8, 1, "s", "the same moment on the clock of the peer, since its tick 0; NaN while unknown"),
    Field("position", _F8, MOST_AXES, "m | rad", "of device or leader (master), of the follower; as decoded (robot)"),
    Field("raw", _F8, MOST_AXES, "m | rad | N | N m", "to be encoded (master); as measured: force, torque (slave)"),
    Field("decoded", _F8, MOST_AXES, "N | N m", "before the limiter (master), what the peer's decoder holds (slave)"),
    Field("predicted", _F8, MOST_AXES, "as raw", "what the peer held of `coded` before an update; NaN if nothing"),
    Field(
        "coded", _F8, MOST_AXES, "as raw", "the sample decided on: `raw`, or with look-ahead the one of that long ago"
    ),
    Field("output", _F8, MOST_AXES, "N | N m | m | rad", "commanded: force, torque (master), position, angle (slave)"),
    Field("bound", _F8, 1, "m | N", "deadband of `coded`, in the unit of what this side encodes; 1 of an arm"),
    Field("weber", _F8, 1, "", "Weber factor of the force channel, as a live change may have left it"),
    Field("credit", _F8, 1, "J", "what the scene gave beyond what it took, since the session began, as known here"),
    Field("tick", _U8, 1, "", "number of the tick on this side"),
    Field("ticks_missed", _U8, 1, "", "deadlines without a tick, so far"),
    Field("slew_ticks", _U8, 1, "", "ticks in which the slew limit held force or torque back, so far (master)"),
    Field("contact_ticks", _U8, 1, "", "ticks in which slave.limits.contact_n held the robot back, so far (slave)"),
    Field("datagrams_sent", _U8, 1, "", "of every kind, so far"),
    Field("datagrams_received", _U8, 1, "", "accepted, so far"),
    Field("datagrams_lost", _U8, 1, "", "sent by the peer and never seen, so far"),
    Field("datagrams_dropped", _U8, 1, "", "received and refused, so far"),
    Field("bytes_sent", _U8, 1, "B", "UDP payload, so far"),
    Field("updates_sent", _U8, 1, "", "samples that crossed the deadband, so far"),
    Field("updates_received", _U8, 1, "", "applied, so far"),
    Field("repeats", _U8, 1, "", "updates sent again for want of an acknowledgement, so far"),
    Field("heartbeats", _U8, 1, "", "sent, so far"),
    Field("second_updates_sent", _U8, 1, "", "samples of the second stream that crossed the deadband, so far"),
    Field("second_updates_received", _U8, 1, "", "of the second stream, applied, so far"),
    Field("surface", _F4, 3, "1 | m", "normal of the fitted plane, centre of the fitted sphere; NaN without"),
    Field("lateness_us", _F4, 1, "us", "from the deadline to the start of the tick"),
    Field("work_us", _F4, 1, "us", "from the start of the tick to its end"),
    Field("codec_us", _F4, 1, "us", "time spent encoding and decoding since the last record"),
    Field("rtt_us", _F4, 1, "us", "round trip, newest estimate; NaN while unknown"),
    Field("one_way_us", _F4, 1, "us", "from the peer to here, newest estimate; NaN while unknown"),
    Field("jitter_us", _F4, 1, "us", "by how much few datagrams exceed their least delay, in the worse direction"),
    Field("incoming_loss", _F4, 1, "", "recent share of the peer's datagrams that never came, 0 to 1"),
    Field("outgoing_loss", _F4, 1, "", "the same of this side's datagrams, as the peer reported it"),
    Field("peer_burst", _F4, 1, "", "mean run of the peer's datagrams that were lost; 0 while unknown"),
    Field("energy", _F4, 1, "J", "what the display may still give to the hand; 0 without an account"),
    Field("surface_size", _F4, 1, "m", "offset d of the plane, radius of the sphere (concave: negative)"),
    Field("surface_stiffness", _F4, 1, "N/m", "of the fitted plane or sphere"),
    Field("second_bound", _F4, 1, "rad | N m", "as `bound`"),
    Field("state", _U1, 1, "", "of the side's state machine, as its own number"),
    Field("fault", _U1, 1, "", "the fault that is active, as its own number; 0 for none"),
    Field("selected", _U1, 1, "", "predictor in use on the channel from the slave, as its index in the bank"),
    Field("sent", _U1, 1, "", "1 if an update was sent in this tick"),
    Field("received", _U1, 1, "", f"updates applied since the last record, {MOST_RECEIVED} for more"),
    Field("clipped", _U1, 1, "", "1 if a limiter changed the output"),
    Field(
        "ramping",
        _U1,
        1,
        "",
        f"1 while a session begins or ends; {RELEASED} while the operator lets go (master.engage)",
    ),
    Field("model", _U1, 1, "", "what the force update in use fitted: 0 none, 1 line, 2 plane, 3 sphere"),
    Field("settings", _U1, 1, "", "how many live changes of settings are in force, modulo 256"),
    Field("buttons", _U1, 1, "", "of the device, the lowest eight as bits (master)"),
    Field("position_selected", _U1, 1, "", "the same of the channel from the master"),
    Field("second_selected", _U1, 1, "", "as `selected`"),
    Field("second_sent", _U1, 1, "", "as `sent`"),
    Field("widened", _U1, 1, "", "1 if the bounded rate of updates widened the deadband in this tick"),
    Field("second_widened", _U1, 1, "", "as `widened`"),
)

_FILL = (0.0,) * MOST_AXES
NAMES = tuple(field.name for field in FIELDS)
COUNTERS = tuple(field.name for field in FIELDS if field.kind == "<u8" and field.name != "tick")  # cumulative fields
FINITE = ("position", "raw", "decoded", "coded", "output")
"""Vectors that are finite in every record; others are NaN while unknown."""


class Layout:
    """The packed record of a side; `fields` are those of `FIELDS` that it has."""

    def __init__(self, axes: int, streams: int) -> None:
        self.axes, self.streams = axes, streams
        self.fields = tuple(field for field in FIELDS if streams > 1 or not field.name.startswith(SECOND))
        sizes = [axes if field.axes == MOST_AXES else field.axes for field in self.fields]
        self.format = "".join(CODES[field.kind] * size for field, size in zip(self.fields, sizes, strict=True))
        self.description = [
            (field.name, field.kind, (size,)) if field.axes > 1 else (field.name, field.kind)
            for field, size in zip(self.fields, sizes, strict=True)
        ]
        # The values of a row, flat. Written out as `namedtuple` does it: a loop takes several times as long.
        vector = "*row.{0}, *FILL[len(row.{0}):]" if axes == MOST_AXES else "*row.{0}"  # virtual time fills up all axes
        form = {MOST_AXES: vector, 3: "*row.{0}", 1: "row.{0}"}
        items = ", ".join(form[field.axes].format(field.name) for field in self.fields)
        self.values: Callable[[Any], tuple[float, ...]] = eval(f"lambda row: ({items})", {"FILL": _FILL})  # noqa: S307 - of the table


@cache
def layout(axes: int, streams: int) -> Layout:
    """The layout of so many axes and streams; raises ValueError for other numbers."""
    if not (1 <= axes <= MOST_AXES and 1 <= streams <= STREAMS):
        raise ValueError(f"a record has 1 to {MOST_AXES} axes and 1 or {STREAMS} streams, got {axes} and {streams}")
    return Layout(axes, streams)


ALL = layout(MOST_AXES, STREAMS)
DESCRIPTION = ALL.description
RECORD = Struct(f"<{ALL.format}")
