"""A session of one stream: its bytes are those that were recorded before there could be a second."""

from hashlib import sha256

import pytest

from protocol.checksum import Checksum
from protocol.emulation import Emulation
from protocol.psk import PresharedKey
from protocol.security import Security
from tests.protocol.harness import KEY, Pair, Side, update_fields

RECORDED = {
    ("checksum", False): "1d2b7936b21160d2fba14e83bb0f9a67f6a69e2b25512d7af22729000f50e5cb",
    ("checksum", True): "db30972eb49def99421e96cabd70bdfed0dfe38c06371b1d6a90de69e414b942",
    ("psk", False): "2cd878a762925cae603b055b4f492ce25cc681d4a1f504b764e4015aeed8bf81",
    ("psk", True): "d9a07ffc5bdf5c20bfba8b281acda5b4aff2dce8b3b5f314c2855b1355aa938e",
}
"""Of the script below: SHA-256 of every datagram in the order in which they left."""


def drive(pair: Pair, now: float, tick: int) -> None:
    """Updates of both sides, some with history, at paces that leave room for heartbeats and repeats."""
    for side, pace, values in ((pair.master, 7, 3), (pair.slave, 61, 3)):
        if tick % pace == 0 and now < 1.2:
            _send(side, now, tick, values, with_previous=tick % 2 == 0)
            side.endpoint.credit = tick


def _send(side: Side, now: float, tick: int, values: int, *, with_previous: bool) -> None:
    stamp, selector, newest, gap, previous = update_fields(tick)
    previous, gap = (previous, max(gap, 1)) if with_previous else ((), 0)
    side.endpoint.send_update(side.local(now), stamp, selector, newest[:values], gap, previous[:values])


@pytest.mark.parametrize("suite", ["checksum", "psk"])
@pytest.mark.parametrize("carries_credit", [False, True])
def test_the_bytes_are_those_of_before(suite: str, carries_credit: bool) -> None:
    security: Security = Checksum() if suite == "checksum" else PresharedKey(KEY)
    faulty = Emulation(delay_s=0.003, jitter_s=0.002, loss=0.1, reorder=0.05, duplicate=0.05)
    changes = {"security": security, "carries_credit": carries_credit, "incoming_values": (3,), "outgoing_values": (3,)}
    pair = Pair(forward=faulty, backward=faulty, master=changes, slave=changes, on_tick=drive, seed=11)
    pair.connect().run(1.5)
    for side in pair.sides:
        side.endpoint.close(side.local(pair.now), "completed")
    pair.run(0.02)
    digest = sha256()
    for _, _, data in pair.tap:
        digest.update(len(data).to_bytes(2, "little") + data)
    assert len(pair.tap) > 200
    assert digest.hexdigest() == RECORDED[suite, carries_credit]
