"""Authenticated stream of messages over a byte stream such as TCP, opened by the key exchange of the sessions.

The caller proves the key with its first message; a call without proof gets no answer. That message may be a recording,
so the other end must send nothing of value before it has opened the first message under the fresh keys.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from weberlink.protocol.counters import SEQUENCE_MASK
from weberlink.protocol.handshake import PADDED_HELLO, pack_map, pack_refusal, read_map
from weberlink.protocol.security import Protection, Security
from weberlink.protocol.wire import CLEAR_BYTES, Kind

LONGEST_PAYLOAD = 60_000
"""Longest payload of a message [bytes]; AES-CCM with a nonce of 13 bytes takes up to 65,535."""
LONGEST_FRAME = LONGEST_PAYLOAD + 64
_HEADER = CLEAR_BYTES
_OPENING = 2


class StreamError(ValueError):
    """A received message is not the next one that the other end sealed; the stream must be closed."""


class RefusedError(ConnectionError):
    """The other end does not prove the key, or refuses the call; the message is one line that says why."""


class SealedStream:
    """Seals outgoing messages and opens incoming ones.

    Message number n of a direction is sealed with n as nonce, so a message opens only if it is the very next one.

    Args:
        protection: keys of this connection.
    """

    def __init__(self, protection: Protection) -> None:
        self._protection = protection
        self._sent = 0
        self._received = 0

    def seal(self, kind: int, payload: bytes) -> bytes:
        """The next message to send, of a kind from 0 to 255.

        Raises:
            ValueError: the payload is too long.
        """
        if len(payload) > LONGEST_PAYLOAD:
            raise ValueError(f"a message has at most {LONGEST_PAYLOAD} bytes, not {len(payload)}")
        sealed = self._protection.seal(self._sent, _header(kind, self._sent) + payload)
        self._sent += 1
        return sealed

    def open(self, frame: bytes) -> tuple[int, bytes]:
        """Kind and payload of the next message.

        Raises:
            StreamError: it is not the next message that the other end sealed.
        """
        number = self._received
        if len(frame) < _HEADER or frame[1:_HEADER] != _header(0, number)[1:]:
            raise StreamError("a message is out of order")
        payload = self._protection.open(number, frame)
        if payload is None:
            raise StreamError("a message was changed on its way")
        self._received += 1
        return frame[0], payload


def _header(kind: int, number: int) -> bytes:
    return bytes((kind,)) + (number & SEQUENCE_MASK).to_bytes(_HEADER - 1, "little")


class StreamTerms(NamedTuple):
    """Terms of a stream that both ends must share.

    Args:
        security: the suite, with its key.
        version: of the messages, 0..255.
        agreement: must be equal at both ends.
        mismatch: message to the user if version or agreement differ.
    """

    security: Security
    version: int
    agreement: Mapping[str, object]
    mismatch: str


class StreamCall:
    """The calling end's half of the handshake.

    Args:
        terms: of the stream.
        entropy: returns that many random bytes.
    """

    def __init__(self, terms: StreamTerms, entropy: Callable[[int], bytes]) -> None:
        self._terms = terms
        self._prologue = bytes((Kind.HELLO, terms.version))
        self._exchange = terms.security.call(self._prologue, entropy(terms.security.private_size))

    def hello(self) -> bytes:
        """The first message, longer than its answer; only once."""
        padding = bytes(PADDED_HELLO - self._terms.security.overhead)
        return self._prologue + self._exchange.hello(pack_map({**self._terms.agreement, "padding": padding}))

    def answered(self, frame: bytes) -> SealedStream:
        """Open the stream with the answer.

        Raises:
            RefusedError: the other end did not prove the key, or refuses and says why.
        """
        opened = self._exchange.open(frame[_OPENING:])
        if opened is None:
            raise RefusedError("it does not hold the same key: --key-file must name a copy of its key file")
        packed, protection = opened
        body = read_map(packed)
        if body is not None and isinstance(body.get("refusal"), str):
            raise RefusedError(str(body["refusal"]))
        if body is None or frame[:_OPENING] != bytes((Kind.WELCOME, self._terms.version)):
            raise RefusedError(f"its answer cannot be read: {self._terms.mismatch}")
        return SealedStream(protection)


def answer_call(
    frame: bytes, terms: StreamTerms, entropy: Callable[[int], bytes]
) -> tuple[bytes, SealedStream | None] | None:
    """The other end's half: the answer to a call and the stream that it opens, or a refusal without a stream.

    Returns:
        None for a message that does not prove the key: it gets no answer.
    """
    security = terms.security
    prologue, message = frame[:_OPENING], frame[_OPENING:]
    exchange = security.hear(prologue, message) if prologue[:1] == bytes((Kind.HELLO,)) else None
    body = None if exchange is None else read_map(exchange.payload)
    if exchange is None or body is None:
        return None
    expected = {**terms.agreement, "padding": body.get("padding")}
    agrees = prologue[1:] == bytes((terms.version,)) and expected == body
    payload = pack_map({}) if agrees else pack_refusal(terms.mismatch, len(message) - security.overhead)
    answered = exchange.answer(payload, entropy(security.private_size))
    if answered is None:
        return None
    reply, protection = answered
    return bytes((Kind.WELCOME, terms.version)) + reply, SealedStream(protection) if agrees else None
