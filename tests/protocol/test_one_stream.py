"""A session of one stream: its datagrams equal those recorded with protocol 5."""

from hashlib import sha256

import pytest

from tests.protocol.harness import KEY, Pair, forms, sample_update
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security

RECORDED = {
    ("checksum", False): "c1e9b80e94d867164cfd4df3035d299626183d438477c4936ddd72fbd2ce54cb",
    ("checksum", True): "95b8d23d8c92493b84b1af7d6127bff8708bba976bed44ebc00e07f0783b89cb",
    ("psk", False): "a8fd71a34dec35bb22c42f2e1f7f69c3381c250429148ae0ef4d4f803409299a",
    ("psk", True): "4fb9614c9f221c6b0539f3d792195e4831bbaf8d9daf12ba0442ebaf6e604959",
}
"""SHA-256 over all datagrams of the session below, in the order in which they left."""


def drive(pair: Pair, now: float, tick: int) -> None:
    """Updates of both sides, some with history, at paces that leave room for heartbeats and repeats."""
    for side, pace in ((pair.master, 7), (pair.slave, 61)):
        if tick % pace == 0 and now < 1.2:
            update = sample_update(tick)
            update = update if tick % 2 == 0 else update._replace(payload=None)
            side.endpoint.send_update(side.local(now), update)
            side.endpoint.credit = tick


@pytest.mark.parametrize("suite", ["checksum", "psk"])
@pytest.mark.parametrize("carries_credit", [False, True])
def test_datagrams_equal_the_recorded_ones(suite: str, carries_credit: bool) -> None:
    security: Security = Checksum() if suite == "checksum" else PresharedKey(KEY)
    faulty = Emulation(delay_s=0.003, jitter_s=0.002, loss=0.1, reorder=0.05, duplicate=0.05)
    changes = {
        "security": security,
        "carries_credit": carries_credit,
        "incoming": (forms(3),),
        "outgoing": (forms(3),),
    }
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
