"""The two messages that open a session, and the comparison of the two configurations.

| datagram | in clear, authenticated | then |
|---|---|---|
| HELLO | kind u8, version u8, identity 8s, stamp u64 | first message of the key exchange |
| WELCOME | kind u8, version u8, stamp u64 of the HELLO that it answers | second message |

Little endian. The header of the HELLO is the prologue of the key exchange (`weberlink.protocol.security`), so a changed
header opens no session. The payload of both messages is a msgpack map: that of a HELLO is `Hello`; that of a WELCOME is
`Welcome`, or `refusal` (text: why there is no session), or `newest` (the stamp that the next HELLO must exceed). Header
and `refusal` are the same in every version from 2 on, so that two versions can tell each other apart.

The identity is a hash of the master's name. The stamp [ns] rises with every HELLO of a master, so that a responder
drops a recorded HELLO for the cost of a look-up. Both messages carry the sender's clock, so the first two datagrams
already map the clocks.
"""

from collections.abc import Callable, Mapping
from hashlib import sha256
from struct import Struct
from typing import Any, NamedTuple

import msgpack

from weberlink.protocol.security import Security
from weberlink.protocol.states import Role
from weberlink.protocol.wire import LONGEST_DATAGRAM, Kind

PROTOCOL_VERSION = 5
PADDED_HELLO = 512
"""A HELLO is at least this long, so that an answer with a reason need not be longer than the HELLO."""
INSTANCE_BYTES = 8
LONGEST_NAME = 64
"""Characters of the name of an end."""
LARGEST_STAMP = (1 << 63) - 1
_HELLO = Struct("<BB8sQ")
_WELCOME = Struct("<BBQ")
HELLO_HEADER, WELCOME_HEADER = _HELLO.size, _WELCOME.size
_LONGEST_CLOCK_US = 1 << 53
_NOTHING = object()


class LocalEnd(NamedTuple):
    """This end, for the handshake: the agreement is packed, the longest round trip that it allows is in s."""

    security: Security
    entropy: Callable[[int], bytes]
    agreement: bytes
    version: int
    epoch: float
    name: str
    expects: str
    longest_round_trip: float


class Hello(NamedTuple):
    """The first message, which stands for its sender from then on.

    Args:
        expects: name of the slave that it wants; "" for any.
        takes_over: whether a master that the slave serves now is to be replaced.
        longest_round_trip_us: largest one that the sender allows.
        round_trip_us: the one that the sender has measured, if it is longer than what both ends allow; else 0.
    """

    agreement: bytes
    clock_us: int
    name: str
    instance: bytes
    expects: str
    takes_over: bool
    longest_round_trip_us: int
    round_trip_us: int


class Welcome(NamedTuple):
    """The answer of a responder that agrees; `delta_us` is the raw delay of the HELLO as it saw it."""

    clock_us: int
    delta_us: int
    name: str
    longest_round_trip_us: int


class HelloHeader(NamedTuple):
    """The part of a HELLO in clear."""

    version: int
    identity: bytes
    stamp: int

    def pack(self) -> bytes:
        return _HELLO.pack(Kind.HELLO, *self)

    def pack_answer(self) -> bytes:
        """The header of a WELCOME to this."""
        return _WELCOME.pack(Kind.WELCOME, self.version, self.stamp)


def identity_of(name: str) -> bytes:
    return sha256(name.encode()).digest()[:8]


def identity_in(header: bytes) -> bytes:
    """The identity that the header of a HELLO names."""
    return bytes(_HELLO.unpack_from(header)[2])


def check_name(name: str) -> str:
    """Return the name of an end if it is valid.

    Raises:
        ValueError: it is empty, too long, or not printable.
    """
    if not _is_name(name):
        raise ValueError(f"a name has 1 to {LONGEST_NAME} printable characters, not {name!r}")
    return name


def _is_name(name: object) -> bool:
    return isinstance(name, str) and 1 <= len(name) <= LONGEST_NAME and name.isprintable()


def read_hello_header(data: bytes) -> HelloHeader | None:
    """The header of a HELLO; None for a datagram that is shorter than a HELLO can be."""
    return HelloHeader(*_HELLO.unpack_from(data)[1:]) if len(data) >= PADDED_HELLO else None


def read_answered(data: bytes) -> int | None:
    """The stamp of the HELLO that a WELCOME answers; None for a datagram that is shorter."""
    stamp: int | None = _WELCOME.unpack_from(data)[2] if len(data) >= WELCOME_HEADER else None
    return stamp


def pack_hello(hello: Hello, overhead: int) -> bytes:
    """The payload of a HELLO, padded so that the datagram has `PADDED_HELLO` bytes."""
    body = {**hello._asdict(), "padding": b""}
    short = PADDED_HELLO - HELLO_HEADER - overhead - len(pack_map(body))
    return pack_map({**body, "padding": bytes(max(0, short))})


def pack_refusal(message: str, room: int) -> bytes:
    """The payload of a refusing WELCOME, of at most `room` bytes; a long message is cut."""
    room -= len(pack_map({"refusal": ""})) + 2  # msgpack spends up to two bytes more on the length of a long text
    text = message.encode(errors="replace")
    if len(text) > room:
        text = text[: max(0, room - 3)] + b"..."
    return pack_map({"refusal": text.decode(errors="ignore")})


def pack_map(body: Mapping[str, object]) -> bytes:
    packed: bytes = msgpack.packb(dict(body))
    return packed


def read_map(packed: bytes) -> dict[str, object] | None:
    """A msgpack map with text keys, or None if it is anything else."""
    try:
        body = msgpack.unpackb(packed, strict_map_key=True)
    except (ValueError, OverflowError, RecursionError, msgpack.UnpackException):
        return None
    if not isinstance(body, dict) or not all(isinstance(key, str) for key in body):
        return None
    return body


def read_fields(body: Mapping[str, object], checks: Mapping[str, Callable[[object], bool]]) -> list[Any] | None:
    """The fields of a message in the order of their checks, or None if one of them fails."""
    values = [body.get(name) for name in checks]
    return values if all(check(value) for check, value in zip(checks.values(), values, strict=True)) else None


def read_hello(body: Mapping[str, object]) -> Hello | None:
    """The fields of a HELLO, each of its type and size, or None."""
    found = read_fields(body, _HELLO_FIELDS)
    return None if found is None else Hello(*found)


def read_welcome(body: Mapping[str, object]) -> Welcome | None:
    """The fields of a WELCOME that agrees, each of its type and size, or None."""
    found = read_fields(body, _WELCOME_FIELDS)
    return None if found is None else Welcome(*found)


def _is_clock(value: object) -> bool:
    return type(value) is int and abs(value) <= _LONGEST_CLOCK_US


def _is_duration(value: object) -> bool:
    return type(value) is int and 0 <= value <= _LONGEST_CLOCK_US


_HELLO_FIELDS: dict[str, Callable[[object], bool]] = {
    "agreement": lambda value: isinstance(value, bytes),
    "clock_us": _is_clock,
    "name": _is_name,
    "instance": lambda value: isinstance(value, bytes) and len(value) == INSTANCE_BYTES,
    "expects": lambda value: value == "" or _is_name(value),
    "takes_over": lambda value: isinstance(value, bool),
    "longest_round_trip_us": _is_duration,
    "round_trip_us": _is_duration,
}
_WELCOME_FIELDS: dict[str, Callable[[object], bool]] = {
    "clock_us": _is_clock,
    "delta_us": _is_clock,
    "name": _is_name,
    "longest_round_trip_us": _is_duration,
}


def pack_agreement(agreement: Mapping[str, object]) -> bytes:
    """The packed agreement.

    Raises:
        ValueError: naming the key whose value msgpack cannot carry, or if the whole does not fit a datagram.
    """
    for key, value in agreement.items():
        try:
            msgpack.packb({key: value})
        except (TypeError, ValueError, OverflowError) as problem:
            raise ValueError(f"agreement {key!r}: {value!r} cannot be sent to the peer ({problem})") from None
    packed = pack_map(agreement)
    if len(packed) > LONGEST_DATAGRAM - PADDED_HELLO:
        raise ValueError(f"the agreement takes {len(packed)} bytes, more than {LONGEST_DATAGRAM - PADDED_HELLO}")
    return packed


def unexpected_slave(expected: str, name: str) -> str:
    """Message to the user: another slave than the expected one answered."""
    return f"the master expects slave {expected!r}, and {name!r} answered"


def differences(role: Role, mine: Mapping[str, object], theirs: Mapping[str, object]) -> str:
    """Every key on which two agreements differ, with both values; "" if they are the same."""
    return "; ".join(
        difference(key, role, mine.get(key, _NOTHING), theirs.get(key, _NOTHING))
        for key in sorted(mine.keys() | theirs.keys())
        if mine.get(key, _NOTHING) != theirs.get(key, _NOTHING)
    )


def difference(key: str, role: Role, mine: object, theirs: object) -> str:
    """Message to the user: what each end has for a key."""
    held = {role: mine, role.other: theirs}
    said = {side: "nothing" if value is _NOTHING else repr(value) for side, value in held.items()}
    master, slave = Role.INITIATOR, Role.RESPONDER
    return f"{key}: {master.value} has {said[master]}, {slave.value} has {said[slave]}"
