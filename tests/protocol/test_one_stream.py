"""A session of one stream: its datagrams equal those recorded with protocol 3."""

from hashlib import sha256

import pytest

from tests.protocol.harness import KEY, Pair, forms, sample_update
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security

RECORDED = {
    ("checksum", False): "90256ecfc4c38bf3638df6e406b6c5083e9df81dc6977f207e60c2231b63c2f5",
    ("checksum", True): "4bf2a2f44e273d36fc3bd54c48114dece6bd815f555601a88c80ff7b3bec6f29",
    ("psk", False): "021065c6bf06a4533cf0834e87dfb702031070f5aec0dbfd442d5b533eca5070",
    ("psk", True): "534ce74542080fad4c74572b6193bda9ab1ee60018eb78845a96b15fee2fa7d6",
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
