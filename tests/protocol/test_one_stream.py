"""A session of one stream: its datagrams equal those recorded with protocol 6."""

from hashlib import sha256

import pytest

from tests.protocol.harness import KEY, Pair, forms, sample_update
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security

RECORDED = {
    ("checksum", False): "ab1eafbd06e9e6a8fb52fc6b9b07078ed5fe158beab3b71910dafbaee626a9d8",
    ("checksum", True): "7213f399c71ec2c7842f46d9bc4370b0122af14e49aea3286858ec0a7f9974ec",
    ("psk", False): "878e800adde42e976c471c07061ef140e7a0445aabba271de6110b5b2615f874",
    ("psk", True): "54356ca8627981672b220f009779d1f2a9ce05fd4e06df10511e734a136fc1f7",
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
