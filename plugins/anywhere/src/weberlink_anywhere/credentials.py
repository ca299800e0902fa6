"""Credentials of limited time for a relay, made from the secret that it shares with its users.

A relay cannot be used without them, and those that somebody has overheard are soon worthless. The scheme is that of
"A REST API For Access To TURN Services" (draft-uberti-behave-turn-rest-00, section 2.2); coturn calls it
`use-auth-secret`.
"""

import base64
import hashlib
import hmac
from pathlib import Path

from weberlink.protocol.keys import KeyFileError, read_private

SHORTEST_SECRET = 16
"""Characters. Whoever overhears an allocation can try secrets against its HMAC at leisure."""


def credentials(secret: str, name: str, now: float, lifetime_s: float) -> tuple[str, str]:
    """User name and password for a relay: `expiry:name`, and base64(HMAC-SHA1(secret, user name)).

    Args:
        secret: that of the relay.
        name: of the user; the relay counts its quotas by it.
        now: seconds since 1970.
        lifetime_s: how long the relay accepts them for a new allocation, > 0.
    """
    user = f"{int(now + lifetime_s)}:{name}"
    digest = hmac.digest(secret.encode(), user.encode(), hashlib.sha1)
    return user, base64.b64encode(digest).decode("ascii")


def read_secret(path: Path) -> str:
    """The secret of a relay: one word in a file that only its owner may read.

    Raises:
        KeyFileError: the file is missing, open to other users, of another user, or not one word that is long enough.
    """
    (secret,) = _words(path, 1, "the secret of the relay in one line")
    if len(secret) < SHORTEST_SECRET:
        raise KeyFileError(f"{path}: a secret has at least {SHORTEST_SECRET} characters, this one {len(secret)}")
    return secret


def read_credentials(path: Path) -> tuple[str, str]:
    """User name and password for a relay: two words in a file that only its owner may read.

    Raises:
        KeyFileError: the file is missing, open to other users, of another user, or not two words.
    """
    user, password = _words(path, 2, "user name and password in one line")
    return user, password


def _words(path: Path, count: int, expected: str) -> list[str]:
    content = read_private(path, f"write into it {expected}; whoever runs the relay has it (docs/relay.md)")
    words = content.decode("ascii", errors="replace").split()
    if len(words) != count or "\ufffd" in "".join(words):
        raise KeyFileError(f"{path} holds something else than {expected}")
    return words
