"""Security suite of a responder that holds a key for each of several peers.

The header of a HELLO names its sender by a hash (`weberlink.protocol.handshake`), which chooses the key. The name in
the sealed payload must have that hash, so the key of one peer opens no session under the name of another.
"""

from collections.abc import Mapping
from typing import ClassVar

from weberlink.protocol.handshake import identity_in, identity_of
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Incoming, Outgoing


class Keyring:
    """The `Security` of a responder.

    Args:
        keys: by name of the peer.
    """

    tag_size: ClassVar[int] = PresharedKey.tag_size
    overhead: ClassVar[int] = PresharedKey.overhead
    private_size: ClassVar[int] = PresharedKey.private_size

    def __init__(self, keys: Mapping[str, bytes]) -> None:
        self._suites = {identity_of(name): PresharedKey(key) for name, key in keys.items()}

    def call(self, prologue: bytes, private: bytes) -> Outgoing:  # noqa: ARG002 - of the contract
        raise TypeError("a keyring is for the end that is called")

    def hear(self, prologue: bytes, message: bytes) -> Incoming | None:
        suite = self._suites.get(identity_in(prologue))
        return None if suite is None else suite.hear(prologue, message)
