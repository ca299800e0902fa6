"""What a flood consists of: the kinds of datagrams that somebody without the key, or with a recording, can send.

Pure, but for the key of the one kind that stands for a long recording. Knows no socket and no rate.
"""

from collections.abc import Sequence
from random import Random

from weberlink.protocol.handshake import HELLO_FIELDS, HELLO_HEADER, Hello, pack_hello, read_fields, read_map
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import CLEAR_BYTES, SEQUENCE_MASK, Kind, kind_of, sequence_of

KINDS = ("forged", "replayed", "truncated", "random", "handshake", "calls")
"""
- forged: the shape of genuine datagrams, newer numbers, other contents
- replayed: genuine ones
- truncated: genuine ones cut short
- random: any bytes, up to what a network carries
- handshake: HELLOs without proof of the key
- calls: HELLOs with it, as someone has who recorded very many calls
"""
ROUNDS = 1024
_LONGEST_RANDOM = 1400
_PROOF = 16
_AHEAD = 200


def load(kind: str, genuine: Sequence[bytes], random: Random, key: bytes, calls: int = ROUNDS) -> list[bytes]:
    """Datagrams of a kind, to be sent over and over."""
    sealed = [data for data in genuine if kind_of(data) in (Kind.UPDATE, Kind.HEARTBEAT)]
    if kind in ("forged", "replayed", "truncated") and not sealed:
        raise ValueError(f"{kind}: nothing genuine was recorded to make it of")
    match kind:
        case "forged":
            newest = sequence_of(sealed[-1])
            return [_forge(random.choice(sealed), newest + random.randint(1, _AHEAD), random) for _ in range(ROUNDS)]
        case "replayed":
            return list(sealed[-ROUNDS:])
        case "truncated":
            return [cut[: random.randrange(1, len(cut))] for cut in random.choices(sealed, k=ROUNDS)]
        case "random":
            return [random.randbytes(random.randint(1, _LONGEST_RANDOM)) for _ in range(ROUNDS)]
        case "handshake":
            return [call[:-_PROOF] + random.randbytes(_PROOF) for call in _calls(genuine, key, random, calls)]
        case "calls":
            return _calls(genuine, key, random, calls)
    raise ValueError(f"there is no kind {kind!r}; there are {', '.join(KINDS)}")


def stamp_of(call: bytes) -> int:
    """When a HELLO was made, by the clock of its master [ns]."""
    stamp: int = HELLO_HEADER.unpack_from(call)[-1]
    return stamp


def _forge(like: bytes, sequence: int, random: Random) -> bytes:
    head = like[:1] + (sequence & SEQUENCE_MASK).to_bytes(CLEAR_BYTES - 1, "little")
    return head + random.randbytes(len(like) - len(head))


def _calls(genuine: Sequence[bytes], key: bytes, random: Random, count: int) -> list[bytes]:
    """HELLOs like a genuine one, of as many calls with the key, whose answers nobody can use any more."""
    security, size = PresharedKey(key), HELLO_HEADER.size
    hello = next((data for data in genuine if kind_of(data) == Kind.HELLO), None)
    heard = None if hello is None else security.hear(hello[:size], hello[size:])
    fields = None if heard is None else read_fields(read_map(heard[0]) or {}, HELLO_FIELDS)
    if hello is None or fields is None:
        raise ValueError("no genuine HELLO was recorded to make others of")
    payload = pack_hello(Hello(*fields), security.overhead)
    *header, stamp = HELLO_HEADER.unpack_from(hello)
    calls, first = [], max(1, stamp - count)
    for rising in range(first, first + count):  # as those of a recording
        packed = HELLO_HEADER.pack(*header, rising)
        calls.append(packed + security.call(packed, random.randbytes(security.private_size), payload)[0])
    return calls
