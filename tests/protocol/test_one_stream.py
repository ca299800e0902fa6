"""A session of one stream: its datagrams equal those recorded with protocol 6."""

from hashlib import sha256

import pytest

from tests.protocol.harness import KEY, Pair, forms, sample_update
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Checksum, Security

RECORDED = {
    ("checksum", False): "8aa19cc7e41b3abfffa6b57a3f1d8c576c3235dbd08f5ecda6605b156d4e5b08",
    ("checksum", True): "c26fa07bceedc3c53ce74b41c615844adf884cc6d8273e074bba836ea37dfe5b",
    ("psk", False): "a0be27f0c5e764327a234048faebc6aff895f6e2459dbd708faa80ad673d3bab",
    ("psk", True): "b6ebf2ccc740d78c26045ab3a3b53dc984caf03702f2ae6ef10428df5bdbac6b",
}
"""SHA-256 over all datagrams of the session below, in the order in which they left."""


def drive(pair: Pair, now: float, tick: int) -> None:
    """Updates of both sides, some with history, at paces that leave room for heartbeats and repeats."""
    for side, pace in ((pair.master, 7), (pair.slave, 61)):
        if tick % pace == 0 and now < 1.2:
            update = sample_update(tick)
            update = update if tick % 2 == 0 else update._replace(payload=None)
            side.endpoint.send_update(side.local(now), update)
            side.endpoint.grant(tick)


@pytest.mark.parametrize("suite", ["checksum", "psk"])
@pytest.mark.parametrize("carries_credit", [False, True])
def test_datagrams_equal_the_recorded_ones(suite: str, carries_credit: bool) -> None:
    security: Security = Checksum() if suite == "checksum" else PresharedKey(KEY)
    faulty = Emulation(delay_s=0.003, jitter_s=0.002, loss=0.1, reorder=0.05, duplicate=0.05)
    changes = {"security": security, "carries_credit": carries_credit, "incoming": (forms(3),), "outgoing": (forms(3),)}
    pair = Pair(link=faulty, master=changes, slave=changes, on_tick=drive, seed=11)
    pair.connect().run(1.5)
    for side in pair.sides:
        side.endpoint.close(side.local(pair.now), "completed")
    pair.run(0.02)
    digest = sha256()
    for _, _, data in pair.tap:
        digest.update(len(data).to_bytes(2, "little") + data)
    assert len(pair.tap) > 200
    assert digest.hexdigest() == RECORDED[suite, carries_credit]
