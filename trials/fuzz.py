"""Send mutated datagrams to endpoints in session: `python -m trials.fuzz --seconds 60 --seed N`.

Three kinds of harm: bytes changed on the way, which no tag survives; contents changed under a valid tag or proof, as a
peer with a fault (or anyone, on a link without a key) could send them; and datagrams of other times and sessions. The
endpoints must never raise, must stay within their queues, and must still carry an update in the end.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from random import Random
from time import perf_counter
from typing import Any

from tests.protocol.harness import KEY, MASTER, SLAVE, Pair, Side, forms, sample_update
from weberlink.protocol import Endpoint, State
from weberlink.protocol.handshake import HELLO_HEADER, LARGEST_STAMP
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Checksum, Protection, Security
from weberlink.protocol.wire import LONGEST_DATAGRAM, Kind

STRANGER = ("203.0.113.9", 9)


class Meddler:
    """A suite that now and then seals changed content: an authentic peer with a fault."""

    def __init__(self, inner: Security, random: Random, rate: float) -> None:
        self.inner, self.random, self.rate = inner, random, rate

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Any]:
        return self.inner.call(prologue, private, self.meddle(payload))

    def answer(self, state: Any, private: bytes, payload: bytes) -> tuple[bytes, Any] | None:
        return self.keys(self.inner.answer(state, private, self.meddle(payload)))

    def open(self, state: Any, message: bytes) -> tuple[bytes, Any] | None:
        return self.keys(self.inner.open(state, message))

    def meddle(self, payload: bytes) -> bytes:
        return mutate(payload, self.random) if self.random.random() < self.rate else payload

    def keys(self, result: tuple[bytes, Protection] | None) -> tuple[bytes, Any] | None:
        return None if result is None else (result[0], MeddledProtection(self, result[1]))


class MeddledProtection:
    def __init__(self, owner: Meddler, inner: Protection) -> None:
        self._owner, self._inner = owner, inner

    def seal(self, sequence: int, clear: bytes, now: float) -> bytes:
        random = self._owner.random
        if random.random() < self._owner.rate:
            changed = bytearray(clear)
            for _ in range(random.randint(1, 4)):
                place = random.choice([0, *range(4, len(clear))])
                changed[place] = random.choice([0, 0x7F, 0x80, 0xFF, random.getrandbits(8)])
            clear = bytes(changed)
        return self._inner.seal(sequence, clear, now)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


def mutate(data: bytes, random: Random) -> bytes:
    changed = bytearray(data or b"\0")
    match random.randrange(6):
        case 0:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
        case 1:
            del changed[random.randrange(len(changed)) :]
        case 2:
            changed += random.randbytes(random.randint(1, 30))
        case 3:
            start = random.randrange(len(changed))
            changed[start : start + 4] = random.choice([b"\x00", b"\xff", b"\x7f"]) * 4
        case 4:
            changed = bytearray(random.randbytes(random.randrange(64)))
        case _:
            changed[0] = random.getrandbits(8)
    return bytes(changed)


def forge_hello(security: Security, random: Random, recorded: bytes) -> bytes:
    """A HELLO with any content, from someone with the key."""
    heard = security.hear(recorded[: HELLO_HEADER.size], recorded[HELLO_HEADER.size :])
    payload = random.randbytes(600) if heard is None else mutate(heard[0], random)
    *header, stamp = HELLO_HEADER.unpack_from(recorded.ljust(HELLO_HEADER.size))
    packed = HELLO_HEADER.pack(*header, (stamp + random.getrandbits(20)) % LARGEST_STAMP)
    message, _ = security.call(packed, random.randbytes(security.private_size), payload)
    return (packed + message)[: LONGEST_DATAGRAM + random.randrange(10)]


def harm(pair: Pair, side: Side, source: tuple[str, int], recorded: list[bytes], random: Random) -> None:
    """Deliver a wrong datagram to one endpoint."""
    data = random.choice(recorded)
    choice = random.random()
    if choice < 0.6:
        data = mutate(data, random)
    elif choice < 0.8 and data[:1] in (bytes((Kind.HELLO,)), bytes((Kind.WELCOME,))):
        data = forge_hello(Checksum() if random.random() < 0.5 else PresharedKey(KEY), random, data)
    address = source if random.random() < 0.7 else STRANGER
    side.endpoint.receive_datagram(data, address, side.local(pair.now))


def check(endpoint: Endpoint) -> None:
    statistics = endpoint.statistics
    assert isinstance(endpoint.state, State)
    assert len(endpoint.datagrams_to_send()) <= 64
    assert 0.0 <= statistics.incoming_loss <= 1.0
    assert 0.0 <= statistics.outgoing_loss <= 1.0
    for burst in (statistics.incoming_burst, statistics.outgoing_burst):
        assert 0.0 <= burst < 256.0
    assert statistics.rtt is None or 0.0 <= statistics.rtt < 1e6


def sessions(seed: int) -> Iterator[Counter[str]]:
    """Endless fuzzed sessions, one after the other; yields what each dropped."""
    random = Random(seed)
    recorded: list[bytes] = []
    while True:
        secure: Security = PresharedKey(KEY) if random.random() < 0.5 else Checksum()
        rate = random.choice([0.0, 0.02, 0.3])
        streams = random.randint(1, 2)
        changes = {
            "outgoing": (forms(3),) * streams,
            "incoming": (forms(3),) * streams,
            "security": Meddler(secure, random, rate),
            "carries_credit": random.random() < 0.5,
            "silence": random.choice([0.1, 10.0]),
        }
        pair = Pair(seed=random.getrandbits(32), master=changes, slave=changes).connect()
        for _ in range(150):
            pair.run(0.004)
            recorded += [data for _, _, data in pair.tap[-4:]]
            del recorded[:-400], pair.tap[:-4]
            for side, source in ((pair.master, SLAVE), (pair.slave, MASTER)):
                update = sample_update(pair.ticks)
                side.endpoint.send_update(side.local(pair.now), update, stream=random.randrange(streams))
                for _ in range(random.randrange(8)):
                    harm(pair, side, source, recorded, random)
        dropped = pair.master.endpoint.statistics.dropped + pair.slave.endpoint.statistics.dropped
        for side in pair.sides:
            check(side.endpoint)
        if rate == 0.0:
            recover(pair, streams)
        yield Counter({reason.value: count for reason, count in dropped.items()})


def recover(pair: Pair, streams: int) -> None:
    """Without further harm, the two must be in a session again and carry updates, unless one was closed."""
    pair.run(8.0)
    if State.CLOSED in (pair.master.endpoint.state, pair.slave.endpoint.state):
        return
    for stream in range(streams):
        update = sample_update(pair.ticks)
        assert pair.master.endpoint.send_update(pair.now, update, stream=stream)
        pair.run(1.0)
        assert pair.slave.updates()[-1].update == update
        assert pair.slave.updates()[-1].stream == stream


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    sys.stdout.write(f"seed {arguments.seed}\n")
    end = perf_counter() + arguments.seconds
    count, total = 0, Counter[str]()
    for dropped in sessions(arguments.seed):
        count, total = count + 1, total + dropped
        if perf_counter() >= end:
            break
    sys.stdout.write(f"{count} sessions; dropped {dict(total.most_common())}\n")


if __name__ == "__main__":
    main()
