"""The two messages that open a session, and the comparison of what the two ends were configured with.

Outer framing, the same in every version of the protocol, so that two versions can at least tell each other apart:

    kind u8 | protocol version u8 | msgpack map | proof

The proof is over everything before it and, in a WELCOME, over the nonce of the HELLO that it answers. A HELLO holds
`nonce` and a refusing WELCOME holds `refusal` in every version; the rest is that of version 1, in `Hello` and
`Welcome`. Both also carry the sender's clock, so the first two datagrams already map the clocks.

Knows neither sockets nor sessions; `protocol.dialer` and `protocol.listener` drive it.
"""

from collections.abc import Mapping
from hashlib import sha256
from hmac import compare_digest
from typing import NamedTuple

import msgpack

from protocol.roles import Role
from protocol.security import Security
from protocol.wire import LONGEST_DATAGRAM, Kind

PROTOCOL_VERSION = 1
NONCE_BYTES = 16
PADDED_HELLO = 512
"""A HELLO is at least this long, so that an answer with a reason in it need not be longer than the question."""
_FRAME_BYTES = 2
_LONGEST_CLOCK_US = 1 << 53
_NOTHING = object()


class Hello(NamedTuple):
    """What the initiator opens with; `agreement` stays packed, as both ends hash these very bytes."""

    agreement: bytes
    nonce: bytes
    key: bytes
    clock_us: int


class Welcome(NamedTuple):
    """The answer of a responder that agrees; `delta_us` is the raw delay of the HELLO as it saw it."""

    nonce: bytes
    key: bytes
    clock_us: int
    delta_us: int


def pack_frame(kind: Kind, version: int, body: Mapping[str, object], security: Security, bound: bytes = b"") -> bytes:
    """One handshake datagram; `bound` is proven with it without being sent."""
    frame: bytes = bytes((kind, version)) + msgpack.packb(dict(body))
    return frame + security.proof(bound + frame)


def open_frame(data: bytes, security: Security, bound: bytes = b"") -> tuple[int, bytes] | None:
    """Version and packed body, if the sender proved the secret; nothing is parsed before that."""
    frame, proof = data[: -security.proof_size], data[-security.proof_size :]
    if len(frame) < _FRAME_BYTES or not compare_digest(security.proof(bound + frame), proof):
        return None
    return frame[1], frame[_FRAME_BYTES:]


def pack_hello(hello: Hello, version: int, security: Security) -> bytes:
    """A HELLO datagram, padded to `PADDED_HELLO`."""
    body = {**hello._asdict(), "padding": b""}
    short = PADDED_HELLO - len(pack_frame(Kind.HELLO, version, body, security))
    return pack_frame(Kind.HELLO, version, {**body, "padding": bytes(max(0, short))}, security)


def pack_refusal(message: str, nonce: bytes, version: int, security: Security, limit: int) -> bytes:
    """A refusing WELCOME of at most `limit` bytes; a long message is cut."""
    empty = len(pack_frame(Kind.WELCOME, version, {"refusal": ""}, security))
    text = message.encode(errors="replace")
    room = limit - empty - 2  # msgpack spends up to two bytes more on the length of a long text
    if len(text) > room:
        text = text[: max(0, room - 3)] + b"..."
    body = {"refusal": text.decode(errors="ignore")}
    return pack_frame(Kind.WELCOME, version, body, security, nonce)


def read_map(packed: bytes) -> dict[str, object] | None:
    """A msgpack map with text keys, or None if it is anything else."""
    try:
        body = msgpack.unpackb(packed, strict_map_key=True)
    except (ValueError, OverflowError, RecursionError, msgpack.UnpackException):
        return None
    if not isinstance(body, dict) or not all(isinstance(key, str) for key in body):
        return None
    return body


def read_hello(body: Mapping[str, object], security: Security) -> Hello | None:
    """The fields of a HELLO, each of its type and size, or None."""
    agreement = _read_bytes(body, "agreement", None)
    nonce = _read_bytes(body, "nonce", NONCE_BYTES)
    key = _read_bytes(body, "key", security.public_size)
    clock_us = _read_integer(body, "clock_us")
    if agreement is None or nonce is None or key is None or clock_us is None:
        return None
    return Hello(agreement, nonce, key, clock_us)


def read_welcome(body: Mapping[str, object], security: Security) -> Welcome | None:
    """The fields of a WELCOME that agrees, each of its type and size, or None."""
    nonce = _read_bytes(body, "nonce", NONCE_BYTES)
    key = _read_bytes(body, "key", security.public_size)
    clock_us = _read_integer(body, "clock_us")
    delta_us = _read_integer(body, "delta_us")
    if nonce is None or key is None or clock_us is None or delta_us is None:
        return None
    return Welcome(nonce, key, clock_us, delta_us)


def _read_bytes(body: Mapping[str, object], name: str, size: int | None) -> bytes | None:
    value = body.get(name)
    return value if isinstance(value, bytes) and (size is None or len(value) == size) else None


def _read_integer(body: Mapping[str, object], name: str) -> int | None:
    value = body.get(name)
    return value if type(value) is int and abs(value) <= _LONGEST_CLOCK_US else None


def transcript(version: int, hello: Hello, nonce: bytes, key: bytes) -> bytes:
    """Hash of all that the session keys depend on but the secrets."""
    agreement = sha256(hello.agreement).digest()
    return sha256(bytes((version,)) + agreement + hello.nonce + nonce + hello.key + key).digest()


def pack_agreement(agreement: Mapping[str, object]) -> bytes:
    """The agreement as it travels.

    Raises:
        ValueError: naming the key whose value msgpack cannot carry, or if the whole does not fit a datagram.
    """
    for key, value in agreement.items():
        try:
            msgpack.packb({key: value})
        except (TypeError, ValueError, OverflowError) as problem:
            raise ValueError(f"agreement {key!r}: {value!r} cannot be sent to the peer ({problem})") from None
    packed: bytes = msgpack.packb(dict(agreement))
    if len(packed) > LONGEST_DATAGRAM - PADDED_HELLO:
        raise ValueError(f"the agreement takes {len(packed)} bytes, more than {LONGEST_DATAGRAM - PADDED_HELLO}")
    return packed


def version_mismatch(master: int, slave: int) -> str:
    return _difference("protocol version", Role.INITIATOR, master, slave)


def differences(role: Role, mine: Mapping[str, object], theirs: Mapping[str, object]) -> str:
    """Every key on which two agreements differ, with both values; "" if they are the same."""
    return "; ".join(
        _difference(key, role, mine.get(key, _NOTHING), theirs.get(key, _NOTHING))
        for key in sorted(mine.keys() | theirs.keys())
        if mine.get(key, _NOTHING) != theirs.get(key, _NOTHING)
    )


def _difference(key: str, role: Role, mine: object, theirs: object) -> str:
    held = {role: mine, role.other: theirs}
    said = {side: "nothing" if value is _NOTHING else repr(value) for side, value in held.items()}
    master, slave = Role.INITIATOR, Role.RESPONDER
    return f"{key}: {master.value} has {said[master]}, {slave.value} has {said[slave]}"
