"""A flood is what it says: its datagrams, its speed, and what it measures."""

import os
import socket
from random import Random
from typing import Any

import pytest

from tests.protocol.harness import KEY, Pair
from tests.soak import ammunition
from tests.soak.flood import FOREIGN, flood, line, violated
from tests.soak.volley import fire
from weberlink.protocol.handshake import HELLO_HEADER
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import Kind, kind_of
from weberlink.system.configuration import SLAVE


@pytest.fixture(scope="module")
def genuine() -> list[bytes]:
    return [data for _, side, data in Pair(seed=4).engage().run(1.0).tap if side.address[1] == 40_000]


@pytest.fixture
def target() -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.bind(("127.0.0.1", 0))
    bound.settimeout(5.0)
    return bound


def test_forged_ones_have_the_shape_of_genuine_ones_and_nothing_else(genuine: list[bytes]) -> None:
    forged = ammunition.load("forged", genuine, Random(1), KEY)
    shapes = {(data[0], len(data)) for data in genuine}
    newest = max(int.from_bytes(data[1:4], "little") for data in genuine if kind_of(data) != Kind.HELLO)
    for data in forged:
        assert (data[0], len(data)) in shapes
        assert int.from_bytes(data[1:4], "little") > newest
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


@pytest.mark.realtime
def test_a_session_lives_through_a_small_flood() -> None:
    figures = flood("forged", SLAVE, FOREIGN, rate=2000, seconds=1.0, seed=1)
    shots, during = figures["shots"], figures["during"]
    assert shots["sent"] > 0
    assert shots["answers"] == 0
    assert during["dropped"][SLAVE] > 0
    assert during["core"][SLAVE] > 0.0
    assert min(figures["before"]["engaged"].values()) > 0.0
    assert "forged" in line(figures)
    assert violated(figures) == []
    assert len(violated(figures, most_core=0.0, most_missed=-1.0)) == 2


def calm(side_share: float = 1.0) -> dict[str, Any]:
    ends = {"master": side_share, "slave": 1.0}
    return {
        "seconds": 10.0,
        "core": {"master": 0.1, "slave": 0.1},
        "missed": {"master": 0.0, "slave": 0.0},
        "engaged": ends,
        "stall_s": 0.01,
        "sent_bytes": {"master": 10_000, "slave": 10_000},
    }


def flooded(during: dict[str, Any] | None = None, **shots: int | None) -> dict[str, Any]:
    heard = {"sent": 1000, "sent_bytes": 512_000, "answers": 0, "answered_bytes": 0}
    return {
        "kind": "calls",
        "target": "slave",
        "shots": {**heard, "longest_answer": 0, "shortest_question": 512, **shots},
        "before": calm(),
        "during": calm() | (during or {}),
        "after": calm(),
    }


@pytest.mark.parametrize(
    ("figures", "told"),
    [
        (flooded(calm(0.9)), "the master was in the session for 90.00 % of the ticks during the flood"),
        (flooded() | {"after": calm(0.0)}, "the master was in the session for 0.00 % of the ticks after the flood"),
        (flooded(answers=1001), "1000 questions of 512000 B had 1001 answers"),
        (flooded(answers=999, answered_bytes=512_001), "had 999 answers of 512001 B"),
        (flooded(answers=1, longest_answer=513), "an answer of 513 B, a question of 512 B"),
        (flooded(answers=1) | {"kind": "forged"}, "1 answers to who has not proved the key"),
        (flooded({"sent_bytes": {"slave": 600_000}}, answers=None), "the slave sent 600000 B"),
    ],
)
def test_what_a_flood_must_not_do_is_seen(figures: dict[str, Any], told: str) -> None:
    (found,) = violated(figures)
    assert told in found


def test_what_a_flood_may_do_is_not_held_against_it() -> None:
    assert violated(flooded(answers=1000, answered_bytes=109_000, longest_answer=109)) == []
    assert violated(flooded(calm(0.9) | {"stall_s": 0.5})) == []
