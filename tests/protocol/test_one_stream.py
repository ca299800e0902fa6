"""A session of one stream: its datagrams equal those recorded with protocol 6."""

from hashlib import sha256

import pytest

from tests.protocol.harness import KEY, Pair, forms, sample_update
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security

RECORDED = {
    ("checksum", False): "2338e21e094b0724b923ceb652060d266e294ff05c1d16766ee6b608743e1a25",
    ("checksum", True): "a2e07ad6cbc0c41527d8721d9355210ca573cf31628fd95bbabb03757bff7809",
    ("psk", False): "708c298cb7386629979b93f0077a45bc3d7fbda8aeb8bbdbe7a906a70d924871",
    ("psk", True): "9ea2728917b156d6600ee722ae736a72ec10bef2cf1f81654fdc975285d97655",
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
