"""Replayed and forged calls: what they cost, and that the master connects while they arrive."""

from collections.abc import Callable
from itertools import cycle
from random import Random

import pytest

from tests.protocol.harness import MASTER, STRANGER, Pair, kind_of, local_end, make_endpoint
from weberlink.protocol import DropReason, Endpoint, Role, State
from weberlink.protocol.aio.sockets import MOST_S
from weberlink.protocol.aio.udp import PEER_SHARE
from weberlink.protocol.handshake import (
    EXCHANGE_PACE,
    EXCHANGE_PACE_ENGAGED,
    HELLO_HEADER,
    KNOWN_MASTERS,
    REFUSAL_PACE,
    STALE_PACE,
    Dialer,
)
from weberlink.protocol.local_end import PROTOCOL_VERSION
from weberlink.protocol.security import Checksum
from weberlink.protocol.wire import Kind


def recorded(count: int, *, name: str = "master", first: int = 1, step: int = 1) -> list[bytes]:
    """HELLOs of earlier runs of a master: proven, with rising stamps."""
    stamps = iter(range(first, first + count * step, step))
    entropy = Random(f"{name} {first}").randbytes
    dialer = Dialer(local_end(name=name, entropy=entropy, stamp=lambda now: next(stamps)))
    return [dialer.hello(0.0) for _ in range(count)]


def forged(count: int) -> list[bytes]:
    random = Random(4)
    header = HELLO_HEADER.pack(Kind.HELLO, PROTOCOL_VERSION, bytes(8), 2**60)
    return [header + random.randbytes(494) for _ in range(count)]


def answers(slave: Endpoint) -> int:
    return sum(kind_of(data) == Kind.WELCOME for data, _ in slave.datagrams_to_send())


class CountingSuite(Checksum):
    opened = 0

    def hear(self, prologue: bytes, message: bytes):  # type: ignore[no-untyped-def]
        self.opened += 1
        return super().hear(prologue, message)


def test_recordings_of_a_known_master_are_dropped_before_any_cryptography_or_opened_rarely() -> None:
    key = CountingSuite()
    slave = make_endpoint(Role.RESPONDER, security=key)
    slave.connect(0.0)
    *old, newest = recorded(400)
    slave.receive_datagram(newest, STRANGER, 0.0)
    for _ in range(500):
        slave.receive_datagram(newest, STRANGER, 0.5)
    assert key.opened == 1 and answers(slave) == 1
    for number in range(20_000):
        slave.receive_datagram(old[number % len(old)], STRANGER, 1.0 + number * 5e-5)
    assert key.opened <= 2 + 1.0 / STALE_PACE
    assert slave.statistics.dropped[DropReason.REPLAYED] == 20_500 - (key.opened - 1)


@pytest.mark.parametrize(
    ("caller", "is_engaged", "pace"),
    [("bob", False, EXCHANGE_PACE), ("bob", True, REFUSAL_PACE), ("ann", True, EXCHANGE_PACE_ENGAGED)],
)
def test_key_exchanges_and_refusals_come_at_their_pace(caller: str, is_engaged: bool, pace: float) -> None:
    """Somebody calls while nobody is served, or ann is in a session."""
    pair = Pair(master={"name": "ann"})
    slave = pair.slave.endpoint
    if is_engaged:
        pair.engage()
    else:
        slave.connect(pair.now)
    answered = 0
    for tick, hello in enumerate(recorded(400, name=caller, first=10**15)):
        slave.receive_datagram(hello, STRANGER, pair.now + tick * 0.001)
        answered += answers(slave)
    assert 0.8 * 0.4 / pace <= answered <= 1 + 0.4 / pace
    assert slave.statistics.dropped[DropReason.OVERLOADED] == 400 - answered


def test_a_forgotten_master_does_not_reopen_its_recordings() -> None:
    slave = make_endpoint(Role.RESPONDER)
    slave.connect(0.0)
    of_all = [recorded(2, name=f"user{number}@host", first=1000 + number) for number in range(4 * KNOWN_MASTERS)]
    now = 0.0
    for _, second in of_all:
        now += EXCHANGE_PACE
        slave.receive_datagram(second, STRANGER, now)
    answers(slave)
    dropped = slave.statistics.dropped[DropReason.REPLAYED]
    for calls in of_all:
        for hello in calls:
            slave.receive_datagram(hello, STRANGER, now)
    replayed = slave.statistics.dropped[DropReason.REPLAYED] - dropped
    assert replayed + answers(slave) == 2 * len(of_all), "all but one, which was told the stamp that it must exceed"
    assert replayed >= 2 * len(of_all) - 1


@pytest.mark.parametrize("back", [1e-9, 1.0, 1e9])
def test_master_with_stepped_clock_continues_from_newest_stamp(back: float) -> None:
    def clock(ahead: float) -> Callable[[float], int]:
        return lambda now: round((2e9 + ahead + now) * 1e9)

    pair = Pair(master={"stamp": clock(0.0)}).engage()
    pair.master.endpoint.close(pair.now, "restarted")
    pair.run(0.1)
    restarted = make_endpoint(Role.INITIATOR, seed=8, epoch=pair.now, stamp=clock(-back - pair.now))
    pair.master.endpoint = restarted
    restarted.connect(pair.now)
    pair.run(0.1)
    assert restarted.state is pair.slave.endpoint.state is State.ENGAGED


FLOODS = {
    "rising stamps": lambda: recorded(4_000),
    "forty masters": lambda: [
        hello for row in zip(*(recorded(30, name=f"user{n}@host") for n in range(40)), strict=True) for hello in row
    ],
    "forged": lambda: forged(100),
}


@pytest.mark.parametrize("kind", FLOODS)
def test_master_connects_under_20000_calls_a_second(kind: str) -> None:
    """A processor opens a call in 60 us and drops one in 10 us, and the kernel keeps 160 of them."""
    key, random, flood = CountingSuite(), Random(1), cycle(FLOODS[kind]())
    pair = Pair(slave={"security": key}).connect()
    slave = pair.slave.endpoint
    genuine: list[bytes] = []
    pair.swallow = lambda side, data: side is pair.master and not genuine.append(data)  # it goes through the port below
    port: list[tuple[bytes, tuple[str, int]]] = []
    budget = 0.0
    while not slave.state is State.ENGAGED is pair.master.endpoint.state:
        assert pair.now <= 3.0
        pair.run(0.001)
        arrivals = [(next(flood), STRANGER) for _ in range(20)]
        for data in genuine:
            arrivals.insert(random.randrange(len(arrivals)), (data, MASTER))
        genuine.clear()
        port = (port + arrivals)[:160]
        budget = min(budget + PEER_SHARE * 0.001, MOST_S)
        while port and budget > 0.0:
            opened = key.opened
            slave.receive_datagram(*port.pop(0), pair.now)
            budget -= 60e-6 if key.opened > opened else 10e-6
