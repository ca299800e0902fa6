"""A call through a server that reads, keeps, repeats, reorders, delays and changes every message of several pairs."""

import os
from dataclasses import dataclass, field
from functools import partial
from random import Random

import pytest

from weberlink_anywhere.calls import LARGEST_MEMORY, OFFER_LIMIT_S, Called, IncomingCalls, Message, OutgoingCall, Ready
from weberlink_anywhere.sealing import LONGEST_BODY, Sealing
from weberlink_anywhere.signalling import MOST_CANDIDATES, Answer, Busy, Description, Offer, usable

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
PATHS = (
    Description("u1", "p" * 22, ("1 1 udp 2130706431 192.0.2.1 4000 typ host", "2 1 udp 1 192.0.2.2 4001 typ relay")),
    Description("u2", "q" * 22, ()),
)


def ends(key: bytes = KEY) -> tuple[OutgoingCall, IncomingCalls]:
    return OutgoingCall(Sealing(key, "master"), os.urandom), IncomingCalls(Sealing(key, "slave"), os.urandom)


def offered(caller: OutgoingCall, waiter: IncomingCalls, now: float = 0.0) -> Message:
    ready = waiter.receive(caller.first(), now, None)
    assert isinstance(ready, Message)
    assert caller.receive(ready) == Ready(None)
    return caller.offer(PATHS, take_over=True)


@pytest.mark.parametrize("reply", [Answer(PATHS[::-1]), Busy("bob")])
def test_all_arrives_as_it_was_and_counts_once(reply: Answer | Busy) -> None:
    caller, waiter = ends()
    ready = waiter.receive(caller.first(), 0.0, "bob")
    assert isinstance(ready, Message)
    assert caller.receive(ready._replace(phase="busy")) is None, "told to be of another kind"
    assert caller.receive(ready) == Ready("bob")
    offer = caller.offer(PATHS, take_over=True)
    told = waiter.receive(offer, 1.0, None)
    assert isinstance(told, Called)
    assert told.offer == Offer(caller.attempt, PATHS, take_over=True)
    assert waiter.receive(offer, 1.0, None) is None
    assert waiter.receive(caller.first(), 1.0, None) is None
    assert caller.receive(waiter.reply(told, reply)) == reply


@pytest.mark.parametrize(("delay", "counts"), [(OFFER_LIMIT_S, True), (OFFER_LIMIT_S + 0.001, False)])
def test_delayed_offer_does_not_count(delay: float, counts: bool) -> None:
    caller, waiter = ends()
    assert isinstance(waiter.receive(offered(caller, waiter, 5.0), 5.0 + delay, None), Called) == counts


def test_calls_are_remembered_within_bounds() -> None:
    caller, waiter = ends()
    offer = offered(caller, waiter)
    for _ in range(LARGEST_MEMORY):
        assert isinstance(waiter.receive(ends()[0].first(), 0.0, None), Message)
    assert waiter.receive(offer, 0.0, None) is None, "the oldest is forgotten"
    assert isinstance(waiter.receive(offered(ends()[0], waiter), 0.0, None), Called)


@pytest.mark.parametrize("body", ["", "0", "zz", "00" * 12, "00" * 28, "é" * 60, "00" * LONGEST_BODY])
@pytest.mark.parametrize("phase", ["call", "ready", "offer", "answer", "busy", "", "\ud800"])
def test_anything_is_ignored(phase: str, body: str) -> None:
    caller, waiter = ends()
    assert waiter.receive(Message(phase, body), 0.0, None) is None
    assert caller.receive(Message(phase, body)) is None


def test_of_what_a_peer_says_a_person_is_shown_one_printable_line() -> None:
    caller, waiter = ends()
    ready = waiter.receive(caller.first(), 0.0, "\x1b[2Jbob\n" + "x" * 1000)
    assert isinstance(ready, Message)
    told = caller.receive(ready)
    assert isinstance(told, Ready) and told.serves is not None
    assert told.serves.isprintable() and told.serves.startswith("[2Jbob") and len(told.serves) <= 300


@pytest.mark.parametrize(
    "line",
    [
        "1 1 udp 1 127.0.0.1 4000 typ host",
        "1 1 udp 1 224.0.0.1 4000 typ host",
        "1 1 udp 1 255.255.255.255 4000 typ host",
        "1 1 udp 1 0.0.0.0 4000 typ host",
        "1 1 udp 1 ::ffff:127.0.0.1 4000 typ host",
        "1 1 udp 1 ::1 4000 typ host",
        "1 1 udp 1 1.2.3 4000 typ host",
        "1 1 udp 1 robot.local 4000 typ host",
        "1 1 udp 1 192.0.2.1 0 typ host",
        "1 1 udp 1 192.0.2.1 65536 typ host",
        f"1 1 udp {'9' * 400} 192.0.2.1 4000 typ host",
        "1 1 tcp 1 192.0.2.1 4000 typ host tcptype active",
        "1 2 udp 1 192.0.2.1 4000 typ host",
        "1 1 udp 1 192.0.2.1 4000",
        "",
        7,
        None,
    ],
)
def test_only_addresses_of_single_hosts_are_probed(line: object) -> None:
    assert usable([line, PATHS[0].candidates[0]]) == PATHS[0].candidates[:1]


def test_a_peer_that_names_250_addresses_is_probed_at_some() -> None:
    caller, waiter = ends()
    offered(caller, waiter)
    many = Description("u", "p", tuple(f"1 1 udp {200 - n} 10.0.0.{n} 4000 typ host" for n in range(1, 251)))
    told = waiter.receive(caller.offer([many], take_over=False), 0.0, None)
    assert isinstance(told, Called)
    assert told.offer.paths == (Description("u", "p", many.candidates[:MOST_CANDIDATES]),)


# --- a hostile server


@dataclass
class Pair:
    """Both ends of a pair, and what they took: by attempt."""

    key: bytes
    calls: list[OutgoingCall] = field(default_factory=list)
    offers: dict[bytes, Offer] = field(default_factory=dict)
    ready_at: dict[bytes, float] = field(default_factory=dict)
    replies: dict[bytes, Answer] = field(default_factory=dict)
    answered: set[bytes] = field(default_factory=set)
    sent: list[Message] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.waiter = IncomingCalls(Sealing(self.key, "slave"), os.urandom)

    def call(self) -> None:
        self.calls.append(OutgoingCall(Sealing(self.key, "master"), os.urandom))
        self.sent.append(self.calls[-1].first())

    def restart(self) -> None:
        self.waiter = IncomingCalls(Sealing(self.key, "slave"), os.urandom)
        self.ready_at.clear()

    def to_slave(self, message: Message, now: float) -> None:
        told = self.waiter.receive(message, now, None)
        if isinstance(told, Message):
            attempt = Sealing(self.key, "master").open(told.phase, told.body)[0]  # type: ignore[index]
            self.ready_at[attempt] = now
            self.sent.append(told)
        elif told is not None:
            attempt = told.offer.attempt
            assert attempt not in self.replies, "an offer counts once"
            assert told.offer == self.offers[attempt], "as its master made it"
            assert now - self.ready_at[attempt] <= OFFER_LIMIT_S
            self.replies[attempt] = Answer((Description(attempt.hex(), "", ()),))
            self.sent.append(self.waiter.reply(told, self.replies[attempt]))

    def to_masters(self, message: Message) -> None:
        for call in self.calls[-4:]:
            told = call.receive(message)
            if isinstance(told, Ready):
                assert call.attempt not in self.offers
                self.offers[call.attempt] = Offer(call.attempt, PATHS[:1], take_over=False)
                self.sent.append(call.offer(PATHS[:1], take_over=False))
            elif told is not None:
                assert told == self.replies[call.attempt], "the answer to this call"
                self.answered.add(call.attempt)


def changed(message: Message, random: Random) -> Message:
    """With another kind, a digit changed, a piece cut off or put in front."""
    phase, body = message
    at = random.randrange(len(body) + 1)
    return random.choice(
        [
            Message(random.choice(["call", "ready", "offer", "answer", "busy"]), body),
            Message(phase, f"{body[:at]}{random.randrange(16):x}{body[at + 1 :]}"),
            Message(phase, body[: 2 * (at // 2)]),
            Message(phase, f"00{body}"),
        ]
    )


@pytest.mark.parametrize("seed", range(8))
def test_nothing_old_foreign_or_changed_passes_a_hostile_server(seed: int) -> None:
    random = Random(seed)
    pairs, now = [Pair(KEY), Pair(OTHER_KEY)], 0.0
    for pair in pairs:
        pair.call()
    for _ in range(2500):
        pair = random.choice(pairs)
        everything = random.choice(pairs).sent
        message = random.choice(random.choice([everything, pair.sent[-3:]]))
        deeds = (
            (pair.call, 4),
            (pair.restart, 0.2),
            (partial(pair.to_slave, message, now), 40),
            (partial(pair.to_masters, message), 40),
            (lambda sent=pair.sent, one=message: sent.append(changed(one, random)), 4),
        )
        random.choices([deed for deed, _ in deeds], [weight for _, weight in deeds])[0]()
        now += random.expovariate(5.0)
    assert min(len(pair.answered) for pair in pairs) > 5, "and calls still succeed"
