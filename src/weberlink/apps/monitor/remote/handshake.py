"""Who may look: the two messages that open a connection, a key exchange as that of `protocol.handshake`. Pure.

The caller proves the key with its first message, and nothing is said before that. Its message may be an old one that
somebody plays back: telemetry is sent only after the first message under fresh keys, which only the caller can make.
"""

from collections.abc import Callable
from hmac import digest

from weberlink.apps.monitor.remote.channel import Channel
from weberlink.protocol.handshake import PADDED_HELLO, pack_map, pack_refusal, read_map
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import Kind
from weberlink.telemetry.record import RECORD
from weberlink.telemetry.ring import SCHEMA

VERSION = 2
Entropy = Callable[[int], bytes]
_HELLO, _WELCOME = (bytes((kind, VERSION)) for kind in (Kind.HELLO, Kind.WELCOME))


class RefusedError(ConnectionError):
    """The other end is no one to talk to; the message is one line that says why."""


def suite(key: bytes) -> PresharedKey:
    """What both ends prove and derive their keys from: a key derived from that of the daemons, which is not kept."""
    return PresharedKey(digest(key, b"weberlink telemetry link", "sha256"))


def _agreement() -> dict[str, object]:
    return {"records": SCHEMA, "record_bytes": RECORD.size}


class Call:
    """The looking end's half.

    Args:
        security: as of `suite`.
        entropy: random bytes of a number.
    """

    def __init__(self, security: PresharedKey, entropy: Entropy) -> None:
        self._exchange = security.call(_HELLO, entropy(security.private_size))
        self._payload = pack_map({**_agreement(), "padding": bytes(PADDED_HELLO - security.overhead)})

    def hello(self) -> bytes:
        """The first message, longer than its answer; only once."""
        return _HELLO + self._exchange.hello(self._payload)

    def answered(self, frame: bytes) -> Channel:
        """The connection that an answer opens.

        Raises:
            RefusedError: the other end did not prove the key, or refuses and says why.
        """
        opened = self._exchange.open(frame[len(_WELCOME) :])
        if opened is None:
            raise RefusedError("it does not prove the key; --key-file must be a copy of the one there")
        packed, protection = opened
        body = read_map(packed)
        if body is not None and isinstance(body.get("refusal"), str):
            raise RefusedError(str(body["refusal"]))
        if body is None or frame[: len(_WELCOME)] != _WELCOME:
            raise RefusedError("its answer cannot be read; use the same release of weberlink on both hosts")
        return Channel(protection)


def answer(frame: bytes, security: PresharedKey, entropy: Entropy) -> tuple[bytes, Channel | None] | None:
    """The sharing end's half: what to say to a first message, and the connection that it opens.

    Returns:
        None for a message that proves nothing, which gets no answer; without a connection, a refusal.
    """
    head, message = frame[: len(_HELLO)], frame[len(_HELLO) :]
    exchange = security.hear(head, message) if head[:1] == _HELLO[:1] else None
    body = None if exchange is None else read_map(exchange.payload)
    if exchange is None or body is None:
        return None
    agrees = head == _HELLO and {**_agreement(), "padding": body.get("padding")} == body
    why = "" if agrees else "the two hosts have different releases of weberlink; use the same one on both"
    payload = pack_map({}) if agrees else pack_refusal(why, len(message) - security.overhead)
    answered = exchange.answer(payload, entropy(security.private_size))
    if answered is None:
        return None
    reply, protection = answered
    return _WELCOME + reply, Channel(protection) if agrees else None
