"""Nothing that an endpoint is sent by somebody without the key makes it send more than it was sent, in virtual time."""

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.protocol.harness import KEY, MASTER, SLAVE, STRANGER, Pair, make_endpoint, sample_update
from trials.fuzz import mutate
from trials.soak import ammunition
from weberlink.protocol import Address, Endpoint, Role, State
from weberlink.protocol.wire import Kind, kind_of
from weberlink.update import Update

NOW = 1.0


def recorded() -> tuple[Pair, list[bytes]]:
    """A session in which both ends have spoken, and all that was said."""
    pair = Pair(seed=1).engage()
    for _ in range(20):
        pair.run(0.01)
        for side in pair.sides:
            update = sample_update(pair.ticks)
            if side.address != MASTER:
                update = Update(pair.ticks, update.selector, update.newest * 2)
            side.endpoint.send_update(side.local(pair.now), update)
    pair.run(0.05)
    return pair, [data for _, _, data in pair.tap]


PAIR, SAID = recorded()
MAGAZINES = {kind: ammunition.load(kind, SAID, Random(2), KEY) for kind in ammunition.KINDS}
UNPROVEN = ("mutated", "random", "forged", "truncated", "handshake")
PROVEN = ("said", "replayed", "calls")
MEANS = st.lists(st.sampled_from(UNPROVEN + PROVEN), min_size=1, max_size=20)


def question(means: str, random: Random) -> bytes:
    while means == "mutated":
        if (changed := mutate(random.choice(SAID), random)) not in SAID:
            return changed
    return random.choice(SAID if means == "said" else MAGAZINES[means])


def answers(endpoint: Endpoint, asked: bytes, source: Address, now: float) -> list[tuple[bytes, Address]]:
    """What an endpoint sends because of a datagram, at once or at its next look at the time."""
    endpoint.receive_datagram(asked, source, now)
    endpoint.handle_timer(now)
    return endpoint.datagrams_to_send()


@examples(60)
@given(seed=st.integers(0, 1 << 32), means=MEANS, is_stranger=st.booleans())
def test_only_a_call_is_answered_once_by_a_responder_and_no_longer(
    seed: int, means: list[str], is_stranger: bool
) -> None:
    random = Random(seed)
    fresh = make_endpoint(Role.RESPONDER)
    fresh.connect(0.0)
    # Nothing is ever due at the fresh one, and what it answers is limited in time.
    for endpoint, peer, now, later in (
        (fresh, MASTER, NOW, 1.0),
        (PAIR.slave.endpoint, MASTER, PAIR.now, 0.0),
        (PAIR.master.endpoint, SLAVE, PAIR.now, 0.0),
    ):
        # An endpoint in a session sends by itself, when something is due: now nothing is, and what comes is an answer.
        endpoint.handle_timer(now)
        endpoint.datagrams_to_send()
        for turn, kind in enumerate(means):
            asked, source = question(kind, random), STRANGER if is_stranger else peer
            sent = answers(endpoint, asked, source, now + later * turn)
            assert len(sent) <= (kind in PROVEN and endpoint is not PAIR.master.endpoint)
            for data, target in sent:
                assert (kind_of(data), kind_of(asked)) == (Kind.WELCOME, Kind.HELLO)
                assert len(data) <= len(asked)
                assert target == source
    assert fresh.state is State.LISTENING
    assert PAIR.master.endpoint.state is State.ENGAGED
