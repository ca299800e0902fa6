"""Both directions of an authenticated stream of messages. Pure: it moves no bytes.

Message number n of a direction is sealed with n as nonce, which is not sent: the receiver counts. So a message opens
only if it is the very next one, unchanged.
"""

from weberlink.protocol.security import Protection

LONGEST_PAYLOAD = 60_000
"""AES-CCM with a nonce of 13 bytes takes up to 65,535 bytes."""
LONGEST_FRAME = LONGEST_PAYLOAD + 64
_HEAD = 4
_LOW_24 = 0xFF_FFFF


class StreamError(ValueError):
    """The stream is not what the other end made; nothing after this can be believed."""


class Channel:
    """Seals what goes out and opens what comes in.

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
        sealed = self._protection.seal(self._sent, _head(kind, self._sent) + payload)
        self._sent += 1
        return sealed

    def open(self, frame: bytes) -> tuple[int, bytes]:
        """Kind and payload of the next message.

        Raises:
            StreamError: it is not the next message that the other end sealed.
        """
        number = self._received
        if len(frame) < _HEAD or frame[1:_HEAD] != _head(0, number)[1:]:
            raise StreamError("a message is not in its place")
        payload = self._protection.open(number, frame)
        if payload is None:
            raise StreamError("a message was changed on its way")
        self._received += 1
        return frame[0], payload


def _head(kind: int, number: int) -> bytes:
    return bytes((kind,)) + (number & _LOW_24).to_bytes(3, "little")
