"""What somebody without the key sends: it raises nothing, disturbs nothing, and makes no end send more."""

from random import Random

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from tests.protocol.harness import (
    KEY,
    MASTER,
    SLAVE,
    STRANGER,
    Pair,
    both,
    by_suite,
    forms,
    kind_of,
    make_endpoint,
    sample_update,
    suites,
)
from trials.fuzz import mutate
from trials.soak.volley import KINDS, load
from weberlink.protocol import Address, Endpoint, Role, State
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security
from weberlink.protocol.wire import DirectionLayout, Kind
from weberlink.update import Update

NOW = 1.0
SHORTEST, _ = DirectionLayout([forms(3)]).lengths
DATAGRAMS = st.one_of(
    st.binary(max_size=100),
    st.builds(
        lambda first, rest: bytes([first]) + rest,
        st.integers(0, 255),
        st.binary(min_size=SHORTEST, max_size=SHORTEST + 40),
    ),
    st.builds(
        lambda kind, body: bytes([kind, 1]) + body, st.sampled_from([Kind.HELLO, Kind.WELCOME]), st.binary(max_size=200)
    ),
)


@by_suite
@examples(60)
@given(st.lists(DATAGRAMS, min_size=1, max_size=20))
def test_no_bytes_raise_or_disturb_a_session(security: Security, datagrams: list[bytes]) -> None:
    pair = Pair(**both(security=security, outgoing=(forms(3),), incoming=(forms(3),))).engage()  # at 0.2 s
    master, slave = (side.endpoint for side in pair.sides)
    for data in datagrams:
        master.receive_datagram(data, SLAVE, 0.21)
        slave.receive_datagram(data, MASTER, 0.21)
    for sender, receiver, source in ((master, slave, MASTER), (slave, master, SLAVE)):
        assert receiver.statistics.dropped.total() == len(datagrams)
        assert sender.state is State.ENGAGED
        assert sender.send_update(0.22, sample_update(220))
        for data, _ in sender.datagrams_to_send():
            receiver.receive_datagram(data, source, 0.22)
        assert receiver.statistics.updates_received[0] == 1


@pytest.mark.parametrize("role", Role)
@given(data=DATAGRAMS)
def test_no_bytes_raise_before_a_session(role: Role, data: bytes) -> None:
    for security in suites():
        endpoint = make_endpoint(role, security=security)
        endpoint.receive_datagram(data, SLAVE, 0.0)
        endpoint.connect(0.0)
        endpoint.receive_datagram(data, SLAVE, 0.0)
        endpoint.close(0.0, "")
        endpoint.receive_datagram(data, SLAVE, 0.0)
        assert endpoint.statistics.dropped.total() == 3


def recorded() -> tuple[Pair, list[bytes]]:
    """A session in which both ends have spoken, and all that was said."""
    pair = Pair(seed=1, **both(security=PresharedKey(KEY))).engage()
    for _ in range(20):
        pair.run(0.01)
        update = sample_update(pair.ticks)
        pair.master.endpoint.send_update(pair.now, update)
        pair.slave.endpoint.send_update(pair.now, Update(pair.ticks, update.selector, update.newest * 2))
    pair.run(0.05)
    return pair, [data for _, _, data in pair.tap]


PAIR, SAID = recorded()
MAGAZINES = {kind: load(kind, SAID, Random(2), KEY) for kind in KINDS}
PROVEN = ("said", "replayed", "calls")
MEANS = st.lists(
    st.sampled_from(("mutated", "random", "forged", "truncated", "handshake", *PROVEN)), min_size=1, max_size=20
)


def question(means: str, random: Random) -> bytes:
    while means == "mutated":
        if (changed := mutate(random.choice(SAID), random)) not in SAID:
            return changed
    return random.choice(SAID if means == "said" else MAGAZINES[means])


@examples(60)
@given(seed=st.integers(0, 1 << 32), means=MEANS, is_stranger=st.booleans())
def test_only_a_call_is_answered_once_by_a_responder_and_no_longer(
    seed: int, means: list[str], is_stranger: bool
) -> None:
    random = Random(seed)
    fresh = make_endpoint(Role.RESPONDER, security=PresharedKey(KEY))
    fresh.connect(0.0)
    cases: list[tuple[Endpoint, Address, float, float]] = [
        (fresh, MASTER, NOW, 1.0),  # nothing is ever due there, and what it answers is limited in time
        (PAIR.slave.endpoint, MASTER, PAIR.now, 0.0),
        (PAIR.master.endpoint, SLAVE, PAIR.now, 0.0),
    ]
    for endpoint, peer, now, later in cases:
        # An endpoint in a session sends by itself, when something is due: now nothing is, and what comes is an answer.
        endpoint.handle_timer(now)
        endpoint.datagrams_to_send()
        for turn, kind in enumerate(means):
            asked, source = question(kind, random), STRANGER if is_stranger else peer
            endpoint.receive_datagram(asked, source, now + later * turn)
            endpoint.handle_timer(now + later * turn)
            sent = endpoint.datagrams_to_send()
            assert len(sent) <= (kind in PROVEN and endpoint is not PAIR.master.endpoint)
            for data, target in sent:
                assert (kind_of(data), kind_of(asked)) == (Kind.WELCOME, Kind.HELLO)
                assert len(data) <= len(asked) and target == source
    assert fresh.state is State.LISTENING
    assert PAIR.master.endpoint.state is State.ENGAGED
