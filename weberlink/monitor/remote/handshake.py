"""Who may look: the two messages that open a connection, made of those of `protocol.handshake`. Pure.

The caller proves the key with its first message, and nothing is said before that. Its message may be an old one that
somebody plays back: telemetry is sent only after the first message under fresh keys, which only the caller can make.
"""

from collections.abc import Callable
from hmac import digest

from protocol.handshake import (
    NONCE_BYTES,
    Hello,
    open_frame,
    pack_agreement,
    pack_frame,
    pack_hello,
    pack_refusal,
    read_hello,
    read_map,
    read_welcome,
    transcript,
)
from protocol.psk import PresharedKey
from protocol.wire import Kind
from telemetry.record import RECORD
from telemetry.ring import SCHEMA
from weberlink.monitor.remote.channel import Channel

VERSION = 1
Entropy = Callable[[int], bytes]


class RefusedError(ConnectionError):
    """The other end is no one to talk to; the message is one line that says why."""


def suite(key: bytes) -> PresharedKey:
    """What both ends prove and derive their keys from: a key derived from that of the daemons, which is not kept."""
    return PresharedKey(digest(key, b"weberlink telemetry link", "sha256"))


def _agreement() -> bytes:
    return pack_agreement({"records": SCHEMA, "record_bytes": RECORD.size})


class Call:
    """The looking end's half.

    Args:
        security: as of `suite`.
        entropy: random bytes of a number.
    """

    def __init__(self, security: PresharedKey, entropy: Entropy) -> None:
        self._security = security
        self._private = entropy(security.private_size)
        self._hello = Hello(_agreement(), entropy(NONCE_BYTES), security.public_key(self._private), 0)

    def hello(self) -> bytes:
        """The first message."""
        return pack_hello(self._hello, VERSION, self._security)

    def answered(self, frame: bytes) -> Channel:
        """The connection that an answer opens.

        Raises:
            RefusedError: the other end did not prove the key, or refuses and says why.
        """
        opened = open_frame(frame, self._security, self._hello.nonce)
        if opened is None:
            raise RefusedError("it does not prove the key; --key-file must be a copy of the one there")
        version, packed = opened
        body = read_map(packed)
        if body is not None and isinstance(body.get("refusal"), str):
            raise RefusedError(str(body["refusal"]))
        welcome = None if body is None or version != VERSION else read_welcome(body, self._security)
        protection = (
            None
            if welcome is None
            else self._security.protect(
                is_initiator=True,
                private=self._private,
                peer_public=welcome.key,
                transcript=transcript(VERSION, self._hello, welcome.nonce, welcome.key),
            )
        )
        if protection is None:
            raise RefusedError("its answer cannot be read; use the same release of weberlink on both hosts")
        return Channel(protection)


def answer(frame: bytes, security: PresharedKey, entropy: Entropy) -> tuple[bytes, Channel | None] | None:
    """The sharing end's half: what to say to a first message, and the connection that it opens.

    Returns:
        None for a message that proves nothing, which gets no answer; without a connection, a refusal.
    """
    opened = open_frame(frame, security)
    if opened is None or frame[0] != Kind.HELLO:
        return None
    version, packed = opened
    body = read_map(packed)
    hello = None if body is None else read_hello(body, security)
    if hello is None:
        return None
    if version != VERSION or hello.agreement != _agreement():
        why = "the two hosts have different releases of weberlink; use the same one on both"
        return pack_refusal(why, hello.nonce, version, security, len(frame)), None
    private, nonce = entropy(security.private_size), entropy(NONCE_BYTES)
    key = security.public_key(private)
    protection = security.protect(
        is_initiator=False,
        private=private,
        peer_public=hello.key,
        transcript=transcript(VERSION, hello, nonce, key),
    )
    if protection is None:
        return None
    welcome = {"nonce": nonce, "key": key, "clock_us": 0, "delta_us": 0}
    return pack_frame(Kind.WELCOME, VERSION, welcome, security, hello.nonce), Channel(protection)
