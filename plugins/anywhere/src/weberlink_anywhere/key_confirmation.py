"""What two hosts tell each other once a code has given them a common secret: names, consent, and a key of the pair.

| message | content | sent |
|---|---|---|
| hello | version, side and name of the sender; from the master, a commitment to its nonce | first |
| nonce | 16 random bytes | by the slave after the hello of the master, then by the master |
| confirm | a tag over both names, by the secret | when the sender would keep the other |
| kept | true | when the sender has stored the key |
| refused | why the sender ends it | in place of any of them |

Both nonces and the secret give two words, which both hosts show and a person compares (as ZRTP does, RFC 6189, section
4.4.1.1). The commitment leaves who is between the hosts, and knows the code, one guess at equal words: 1 in 65,536.

Each is a JSON object of one key. All travel encrypted and numbered by the channel of the code, which is one of
magic-wormhole. A host stores nothing before it has the confirmation of the other one, and takes it back without `kept`.
"""

import hmac
import json
from hashlib import sha256
from typing import Any, NamedTuple

from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from weberlink.bounded_json import parse
from weberlink.protocol.keys import KEY_BYTES, check_name
from weberlink.text import one_line

VERSION = 2
HELLO, NONCE, CONFIRM, KEPT, REFUSED = "hello", "nonce", "confirm", "kept", "refused"
NONCE_BYTES = 16
_LONGEST_MESSAGE = 2048


class PairingError(Exception):
    """The two hosts do not pair; the message is one line for the user."""


class RefusedThereError(PairingError):
    """The other host ended it."""


class Names(NamedTuple):
    """What the two ends of a pair call themselves."""

    master: str
    slave: str


def pair_key(secret: bytes, names: Names) -> bytes:
    """Key of the pair, `KEY_BYTES`, which depends on both names and on who is master (HKDF-SHA256, RFC 5869)."""
    return _derive(secret, "key", names)


def confirmation(secret: bytes, names: Names, side: str) -> str:
    """Tag by which `side` confirms that it knows the secret and both names."""
    return _derive(secret, f"confirmed by the {side}", names).hex()


def is_confirmed(tag: object, secret: bytes, names: Names, side: str) -> bool:
    """Whether the tag is that of `side`."""
    expected = confirmation(secret, names, side)
    return isinstance(tag, str) and hmac.compare_digest(tag.encode(), expected.encode())


def message(kind: str, content: object) -> bytes:
    """One message, as it is sent."""
    return json.dumps({kind: content}).encode("ascii")


def hello(side: str, name: str, commitment: str = "") -> bytes:
    return message(HELLO, {"version": VERSION, "side": side, "name": name, "commitment": commitment})


def commitment(nonce: bytes) -> str:
    """What the master says of its nonce before it knows that of the slave."""
    return sha256(nonce).hexdigest()


def nonce_in(content: object, committed: str | None) -> bytes:
    """The nonce of the other host.

    Args:
        content: as received.
        committed: what its hello said of it; None for nothing.

    Raises:
        PairingError: it is none, or another one than its hello said.
    """
    try:
        nonce = bytes.fromhex(content) if isinstance(content, str) else b""
    except ValueError:
        nonce = b""
    if len(nonce) != NONCE_BYTES or committed not in (None, commitment(nonce)):
        raise PairingError("the other host sent another nonce than it said; somebody may be between the two hosts")
    return nonce


def words_to_compare(secret: bytes, names: Names, master_nonce: bytes, slave_nonce: bytes) -> bytes:
    """Two bytes, each of which stands for a word of the PGP list: even words first."""
    info = f"words {master_nonce.hex()} {slave_nonce.hex()}"
    return _derive(secret, info, names)[:2]


def read(text: bytes, kind: str) -> Any:
    """Content of a message of the other host.

    Raises:
        RefusedThereError: it is a refusal.
        PairingError: it is no message of this kind.
    """
    try:
        content = parse(text, _LONGEST_MESSAGE)
    except ValueError:
        content = None
    if isinstance(content, dict) and isinstance(reason := content.get(REFUSED), str):
        raise RefusedThereError(f"the other host refused: {one_line(reason)}")
    if not isinstance(content, dict) or kind not in content:
        raise PairingError("the other host sent what is no message of a pairing")
    return content[kind]


def name_in(content: object, side: str) -> str:
    """Name of the other host in the content of its hello.

    Args:
        content: as received.
        side: of this host.

    Raises:
        PairingError: it is of another version, or of the same side, or its name cannot be used.
    """
    given = content if isinstance(content, dict) else {}
    version, other, name = given.get("version"), given.get("side"), given.get("name", "")
    if version != VERSION:
        raise PairingError("the other host pairs by another version; install the same weberlink on both")
    if other != ("slave" if side == "master" else "master"):
        raise PairingError("both hosts are of the same side; one invites with slave, the other joins with master")
    try:
        return check_name(name)
    except ValueError as error:
        raise PairingError(f"the other host: {error}; set link.names there") from None


def _derive(secret: bytes, purpose: str, names: Names) -> bytes:
    info = json.dumps(["weberlink pairing", VERSION, purpose, names.master, names.slave]).encode("ascii")
    return HKDF(SHA256(), KEY_BYTES, salt=None, info=info).derive(secret)
