"""The telemetry record of one tick of one side: one table of fields, and what follows from it.

A side fills the fields by name in a `weberlink.telemetry.row.Row`, and writes those that its parts have. Readers see
all fields, with 0 in those that nobody fills.
"""

from collections.abc import Callable, Sequence
from functools import cache
from math import nan
from struct import Struct
from typing import Any, NamedTuple

from weberlink.geometry.joints import MOST_JOINTS

AXES = ("x", "y", "z")
JOINTS = (*map(str, range(1, MOST_JOINTS + 1)), "gripper")
"""Places of an arm's axes in the vectors of a joint session: the joints in order, the gripper always last."""
UNKNOWN = (nan, nan, nan)  # a vector that is not known

RELEASED = 2  # value of `ramping` while the operator does not hold the button that lets the robot follow

MOST_RECEIVED = 255  # largest value of `received`: a peer may send any number of updates between two ticks

# numpy's names of the types (little endian) beside those of struct.
CODES = {"<f8": "d", "<f4": "f", "<u8": "Q", "u1": "B"}


HAND, ROTATION, ARM = "hand", "rotation", "arm"
PARTS = (HAND, ROTATION, ARM)


class Field(NamedTuple):
    """One quantity of a record."""

    name: str
    kind: str  # numpy's name of its type
    axes: int  # 1 for a number, 3 for a vector, and `len(JOINTS)` for the axes of an arm
    unit: str
    meaning: str
    part: str = ""  # of a system that fills it; empty if every system does


# Wide types come first, in whichever parts are recorded: so every value of a packed record is aligned.
_F8, _U8, _F4, _U1, _ARM_AXES = "<f8", "<u8", "<f4", "u1", len(JOINTS)
FIELDS = (
    Field("at", _F8, 1, "s", "deadline of the tick, monotonic clock of this host"),
    Field("peer_at", _F8, 1, "s", "the same moment on the clock of the peer, since its tick 0; NaN while unknown"),
    Field("position", _F8, 3, "m", "position of the device (master) or commanded position as decoded (slave)", HAND),
    Field("raw", _F8, 3, "m | N", "to be encoded: command of the control scheme (master), force (slave)", HAND),
    Field("decoded", _F8, 3, "N", "force before the limiter (master), what the peer's decoder holds (slave)", HAND),
    Field("predicted", _F8, 3, "m | N", "what the peer held of `coded` before an update; NaN if nothing", HAND),
    Field("coded", _F8, 3, "m | N", "the sample decided on: `raw`, or with look-ahead the one of that long ago", HAND),
    Field("output", _F8, 3, "N | m", "commanded to the device: force (master), to the robot: position (slave)", HAND),
    Field("bound", _F8, 1, "m | N", "deadband of `coded`, in the unit of what this side encodes"),
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
    Field("rotation_updates_sent", _U8, 1, "", "samples of the rotation that crossed the deadband, so far", ROTATION),
    Field("rotation_updates_received", _U8, 1, "", "of the rotation, applied, so far", ROTATION),
    Field("gripper_updates_sent", _U8, 1, "", "samples of the gripper that crossed the deadband, so far", ARM),
    Field("gripper_updates_received", _U8, 1, "", "of the gripper, applied, so far", ARM),
    Field("surface", _F4, 3, "1 | m", "normal of the fitted plane, centre of the fitted sphere; NaN without", HAND),
    Field("rotation_raw", _F4, 3, "rad | N m", "as measured: rotation vector (master), torque (slave)", ROTATION),
    Field("rotation_decoded", _F4, 3, "N m", "torque before the limiter; what the peer's decoder holds", ROTATION),
    Field("rotation_output", _F4, 3, "N m | rad", "commanded: torque (master), rotation vector (slave)", ROTATION),
    Field("joint_position", _F4, _ARM_AXES, "rad", "measured angles of the leader (master), follower (slave)", ARM),
    Field("joint_raw", _F4, _ARM_AXES, "rad | N m", "to be encoded: commanded angles (master), torques (slave)", ARM),
    Field("joint_predicted", _F4, _ARM_AXES, "rad | N m", "as `predicted`", ARM),
    Field("joint_decoded", _F4, _ARM_AXES, "N m", "torques before the limiter; what the peer's decoder holds", ARM),
    Field("joint_output", _F4, _ARM_AXES, "N m | rad", "commanded: torques (master), angles (slave)", ARM),
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
    Field("surface_size", _F4, 1, "m", "offset d of the plane, radius of the sphere (concave: negative)", HAND),
    Field("surface_stiffness", _F4, 1, "N/m", "of the fitted plane or sphere", HAND),
    Field("rotation_bound", _F4, 1, "rad | N m", "deadband of the rotation that this side encodes", ROTATION),
    Field("state", _U1, 1, "", "of the side's state machine, as its own number"),
    Field("fault", _U1, 1, "", "the fault that is active, as its own number; 0 for none"),
    Field("selected", _U1, 1, "", "predictor in use on the force channel, as its index in the bank", HAND),
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
    Field("model", _U1, 1, "", "what the force update in use fitted: 0 none, 1 line, 2 plane, 3 sphere", HAND),
    Field("settings", _U1, 1, "", "how many live changes of settings are in force, modulo 256"),
    Field("buttons", _U1, 1, "", "of the device, the lowest eight as bits (master)"),
    Field("position_selected", _U1, 1, "", "predictor in use on the position channel, as its index in the bank", HAND),
    Field("gripper_sent", _U1, 1, "", "1 if an update of the gripper was sent in this tick", ARM),
    Field(
        "rotation_selected", _U1, 1, "", "predictor in use on the torque channel, as its index in the bank", ROTATION
    ),
    Field("rotation_sent", _U1, 1, "", "1 if an update of the rotation was sent in this tick", ROTATION),
    Field("widened", _U1, 1, "", "1 if the bounded rate of updates widened the deadband in this tick"),
    Field("rotation_widened", _U1, 1, "", "1 if it widened that of the rotation", ROTATION),
)

NAMES = tuple(field.name for field in FIELDS)
COUNTERS = tuple(field.name for field in FIELDS if field.kind == "<u8" and field.name != "tick")  # cumulative fields
FINITE = (
    *("position", "raw", "decoded", "coded", "output"),
    *("rotation_raw", "rotation_decoded", "rotation_output"),
    *("joint_position", "joint_raw", "joint_decoded", "joint_output"),
)
"""Vectors that are finite in every record; others are NaN while unknown."""


class Layout:
    """The packed record of a system with some of the `PARTS`.

    Attributes:
        parts: as bits, the first part lowest.
        fields: in the order of `FIELDS`.
        values: gives the values of a row, flat, in the order of the fields.
    """

    def __init__(self, parts: Sequence[str]) -> None:
        self.parts = sum(1 << PARTS.index(part) for part in parts)
        self.fields = tuple(field for field in FIELDS if field.part in ("", *parts))
        self.format = "".join(CODES[field.kind] * field.axes for field in self.fields)
        self.description = [
            (field.name, field.kind, (field.axes,)) if field.axes > 1 else (field.name, field.kind)
            for field in self.fields
        ]
        # Written out as `namedtuple` does it: a loop over the fields takes several times as long.
        items = ", ".join(f"*row.{field.name}" if field.axes > 1 else f"row.{field.name}" for field in self.fields)
        self.values: Callable[[Any], tuple[float, ...]] = eval(f"lambda row: ({items})")  # noqa: S307 - of the table


@cache
def layout(parts: int) -> Layout:
    """The layout of parts as bits; raises ValueError for other bits."""
    if not 0 <= parts < 1 << len(PARTS):
        raise ValueError(f"parts must be bits of {len(PARTS)} parts, got {parts:#x}")
    return Layout([part for bit, part in enumerate(PARTS) if parts >> bit & 1])


ALL = layout((1 << len(PARTS)) - 1)
DESCRIPTION = ALL.description
RECORD = Struct(f"<{ALL.format}")
