"""Floods: their datagrams, their rate, and the law on answers."""

import os
import socket
from random import Random

import pytest

from tests.protocol.harness import KEY, Pair
from tests.soak import ammunition
from tests.soak.laws import answers_little
from tests.soak.volley import fire
from weberlink.protocol.handshake import HELLO_HEADER
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import Kind, kind_of, sequence_of


@pytest.fixture(scope="module")
def genuine() -> list[bytes]:
    return [data for _, side, data in Pair(seed=4).engage().run(1.0).tap if side.address[1] == 40_000]


@pytest.fixture
def target() -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.bind(("127.0.0.1", 0))
    bound.settimeout(5.0)
    return bound


def test_forged_datagrams_share_only_the_shape(genuine: list[bytes]) -> None:
    forged = ammunition.load("forged", genuine, Random(1), KEY)
    shapes = {(data[0], len(data)) for data in genuine}
    newest = max(sequence_of(data) for data in genuine if kind_of(data) != Kind.HELLO)
    for data in forged:
        assert (data[0], len(data)) in shapes
        assert sequence_of(data) > newest
    assert not set(forged) & set(genuine)


def test_the_other_kinds(genuine: list[bytes]) -> None:
    made = {kind: ammunition.load(kind, genuine, Random(1), KEY) for kind in ammunition.KINDS}
    assert set(made["replayed"]) <= set(genuine)
    assert all(any(data.startswith(cut) and data != cut for data in genuine) for cut in made["truncated"])
    assert all(1 <= len(data) <= 1400 for data in made["random"])
    security = PresharedKey(KEY)
    opened = {kind: [security.hear(data[:HELLO_HEADER], data[HELLO_HEADER:]) for data in made[kind]] for kind in made}
    assert not any(opened["handshake"])
    assert all(opened["calls"])
    assert len(set(made["calls"])) == ammunition.ROUNDS
    with pytest.raises(ValueError, match="nothing genuine"):
        ammunition.load("forged", [], Random(1), KEY)
    with pytest.raises(ValueError, match="no genuine HELLO"):
        ammunition.load("calls", [], Random(1), KEY)


def order(target: socket.socket, **changes: object) -> dict[str, object]:
    return {
        "target": target.getsockname(),
        "source": ("127.0.0.3", 0),
        "spoof": False,
        "rate": 1000,
        "seconds": 0.3,
        "datagrams": [b"question".hex()],
        **changes,
    }


def test_a_volley_keeps_its_rate_and_counts_its_bytes(target: socket.socket) -> None:
    with target:
        shots = fire(order(target))
        assert 0 < shots["sent"] <= 1000 * shots["seconds"] + 1
        assert shots["sent_bytes"] == 8 * shots["sent"]
        assert target.recvfrom(100)[1][0] == "127.0.0.3"
        assert (shots["answers"], shots["longest_answer"], shots["shortest_question"]) == (0, 0, 8)


def test_a_spoofed_datagram_seems_to_come_from_the_peer(target: socket.socket) -> None:
    if os.geteuid() != 0:
        pytest.skip("raw sockets need root")
    with target:
        shots = fire(order(target, spoof=True, source=("127.0.0.1", 45_678)))
        assert shots["sent"] > 0
        assert target.recvfrom(100) == (b"question", ("127.0.0.1", 45_678))


@pytest.mark.parametrize(
    ("shots", "told"),
    [
        ({"answers": 1001}, "1000 questions of 512000 B had 1001 answers"),
        ({"answers": 999, "answered_bytes": 512_001}, "had 999 answers of 512001 B"),
        ({"answers": 1, "longest_answer": 513}, "an answer of 513 B, a question of 512 B"),
    ],
)
def test_too_many_or_too_long_answers_are_seen(shots: dict[str, int], told: str) -> None:
    fair = {"sent": 1000, "sent_bytes": 512_000, "answers": 1000, "answered_bytes": 109_000}
    fair |= {"longest_answer": 109, "shortest_question": 512}
    assert answers_little(fair, is_proven=True) == []
    assert answers_little(fair, is_proven=False) == ["1000 answers to who has not proved the key"]
    (found,) = answers_little(fair | shots, is_proven=True)
    assert told in found
