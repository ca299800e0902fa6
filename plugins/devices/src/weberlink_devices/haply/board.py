"""Messages of the Haply board.

Sources: the board's firmware (Arduino Due, 2017; M0, 2018) and the vendor's libraries in C++ and Python, which agree on
the order of the bytes. Numbers are 32-bit floats, least significant byte first:

| message | bytes |
|---|---|
| reset | 0, 0 |
| setup | 1, id, motor ports, their directions, encoder ports, their directions, number and pins of analog inputs, \
number and pins of PWM outputs, then offset [deg] and counts per turn of each encoder |
| torques | 2, id, a byte for each PWM output, a torque for each motor [N m] |
| answer to torques | id, a value for each analog input, an angle for each encoder [deg] |

Ports are bits, port 1 the lowest; values for motors and encoders come in the order of the ports; direction 0 is
clockwise, 1 counter-clockwise. The host chooses the id. There is no framing and no checksum, and the firmware does not
wait for the first bytes of a message: it must be written at once. A first byte that begins no message is ignored.

Setup takes the arms to be at the offsets now, so a second setup moves the origin. Neither reset nor setup takes the
torque off a motor, and no watchdog does.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from struct import Struct
from typing import NamedTuple
from zlib import crc32

from weberlink.hardware.fault import BadReply

RESET = bytes((0, 0))
CLOCKWISE, COUNTER_CLOCKWISE = 0, 1

_IGNORED = 3
"""Begins no message, and is the most significant byte of a negligible torque (4e-37 N m)."""
_SETUP = Struct("<10B4f")
_TORQUES = Struct("<2B2f")
_REPLY = Struct("<B2f")
REPLY_SIZE = _REPLY.size

ROUNDING = 2e-6
"""Rounding of the board: a few units in the last place of a 32-bit float."""

LEAST_ID, IDS = 16, 112
"""This range excludes the id 5 of the vendor's programs and ids beyond a signed byte."""

Pair = tuple[float, float]


class BoardMotor(NamedTuple):
    port: int
    direction: int


class BoardEncoder(NamedTuple):
    port: int
    direction: int
    counts_per_turn: float


@dataclass(frozen=True)
class HaplyBoard:
    """A board with motors and encoders 1 and 2 on it."""

    motors: tuple[BoardMotor, BoardMotor]
    encoders: tuple[BoardEncoder, BoardEncoder]
    home_deg: Pair  # angles of the encoders when it is set up
    whole_counts: bool = True
    """Whether its answers are counts of the encoders times 360 over the counts per turn and nothing in between, as both
    firmwares have it. A reply with lost or torn bytes seldom passes this check."""

    @cached_property
    def id(self) -> int:
        """Derived from all fields: only a board with exactly this setup answers it with angles."""
        return LEAST_ID + crc32(self._setup(0)) % IDS

    @property
    def setup(self) -> bytes:
        return self._setup(self.id)

    @property
    def bare_reply(self) -> bytes:
        """Reply of a board that does not know this id: it was never set up, or restarted since."""
        return bytes((self.id,))

    def torques(self, first: float, second: float) -> bytes:
        """Message that commands the torques of motors 1 and 2 [N m]."""
        in_order = (first, second) if self.motors[0].port < self.motors[1].port else (second, first)
        return _TORQUES.pack(2, self.id, *in_order)

    @property
    def torques_off(self) -> bytes:
        """Message for zero torque that is understood even after the first part of a torque message.

        Ignored bytes fill up that message, or stand for nothing. Zeros behind half a message would be resets, after
        which the board no longer knows the id and keeps its torques.
        """
        off = self.torques(0.0, 0.0)
        return bytes((_IGNORED,)) * (len(off) - 1) + off

    def angles(self, reply: bytes) -> Pair:
        """Angles of encoders 1 and 2 [deg] in a reply.

        Raises:
            BadReply: bytes are missing or too many, the id is another, or an angle is none that an encoder has.
        """
        if len(reply) != REPLY_SIZE:
            raise BadReply(f"{len(reply)} bytes of {REPLY_SIZE} came in answer")
        id_, first, second = _REPLY.unpack(reply)
        if id_ != self.id:
            raise BadReply(f"an answer from device {id_} instead of {self.id}: bytes were lost")
        if not (isfinite(first) and isfinite(second)):
            raise BadReply(f"answered the angles {first} and {second} deg: bytes were lost")
        angles = (first, second) if self.encoders[0].port < self.encoders[1].port else (second, first)
        for encoder, angle in zip(self.encoders, angles, strict=True):
            if self.whole_counts and not _is_whole(angle * encoder.counts_per_turn / 360.0):
                raise BadReply(f"answered {angle:g} deg, which is between two counts of an encoder: bytes were lost")
        return angles

    def _setup(self, id_: int) -> bytes:
        motors = sorted(self.motors)
        (first, first_deg), (second, second_deg) = sorted(zip(self.encoders, self.home_deg, strict=True))
        return _SETUP.pack(
            *(1, id_),
            *(_bits(each.port for each in motors), motors[0].direction, motors[1].direction),
            *(_bits((first.port, second.port)), first.direction, second.direction),
            *(0, 0),
            *(first_deg, first.counts_per_turn),
            *(second_deg, second.counts_per_turn),
        )


def _is_whole(counts: float) -> bool:
    """Whether a count is whole up to the rounding of the angle; 0 is not rounded."""
    nearest = round(counts)
    return counts == 0.0 if nearest == 0 else abs(counts - nearest) <= ROUNDING * max(1.0, abs(counts))


def _bits(ports: Iterable[int]) -> int:
    return sum(1 << (port - 1) for port in ports)
