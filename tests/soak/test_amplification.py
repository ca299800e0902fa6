"""Nothing that an endpoint is sent by somebody without the key makes it send more than it was sent, in virtual time.

An endpoint in a session sends by itself, when something is due. So nothing is due when the questions are put: whatever
comes out then is an answer to them.
"""

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.protocol.fuzz import mutate
from tests.protocol.harness import KEY, MASTER, SLAVE, Pair, Side, make_endpoint, sample_update
from tests.soak import ammunition
from weberlink.protocol import Address, Connected, Endpoint, Role, State
from weberlink.protocol.wire import Kind, kind_of
from weberlink.update import Update

STRANGER: Address = ("203.0.113.9", 9)
NOW = 1.0


def recorded(seed: int) -> tuple[Pair, list[bytes]]:
    """A session in which both ends have spoken, and all that was said."""
    pair = Pair(seed=seed).engage()
    for _ in range(20):
        pair.run(0.01)
        for side in pair.sides:
            side.endpoint.send_update(side.local(pair.now), _update(side, pair.ticks))
    pair.run(0.05)
    return pair, [data for _, _, data in pair.tap]


def _update(side: Side, tick: int) -> Update:
    update = sample_update(tick)
    return update if side.address == MASTER else Update(tick, update.selector, update.newest * 2)


PAIR, SAID = recorded(1)
HELLOS = [data for data in SAID if kind_of(data) == Kind.HELLO]
MEANS = st.sampled_from(["mutated", "replayed", "random", *ammunition.KINDS])


def answers(endpoint: Endpoint, question: bytes, source: Address, now: float) -> list[tuple[bytes, Address]]:
    """What an endpoint sends because of a datagram, at once or at its next look at the time."""
    endpoint.receive_datagram(question, source, now)
    endpoint.handle_timer(now)
    return endpoint.datagrams_to_send()


def quiet(endpoint: Endpoint, now: float) -> None:
    """Nothing is due, and nothing waits."""
    endpoint.handle_timer(now)
    endpoint.datagrams_to_send()


def question(means: str, random: Random) -> bytes:
    match means:
        case "mutated":
            return mutate(random.choice(SAID), random)
        case "replayed":
            return random.choice(SAID)
        case "random":
            return random.randbytes(random.randrange(1500))
    return random.choice(MAGAZINES[means])


MAGAZINES = {kind: ammunition.load(kind, SAID, Random(2), KEY) for kind in ammunition.KINDS}


@examples(40)
@given(seed=st.integers(0, 1 << 32), means=st.lists(MEANS, min_size=1, max_size=20), is_stranger=st.booleans())
def test_responder_answers_once_and_no_longer_than_asked(seed: int, means: list[str], is_stranger: bool) -> None:
    random, source = Random(seed), STRANGER if is_stranger else MASTER
    fresh = make_endpoint(Role.RESPONDER)
    fresh.connect(0.0)
    # Nothing is ever due at the fresh one, and what it answers is limited in time.
    for endpoint, now, later in ((fresh, NOW, 1.0), (PAIR.slave.endpoint, PAIR.now, 0.0)):
        quiet(endpoint, now)
        for turn, kind in enumerate(means):
            asked = question(kind, random)
            sent = answers(endpoint, asked, source, now + later * turn)
            assert len(sent) <= 1
            for data, target in sent:
                assert kind_of(data) == Kind.WELCOME
                assert kind_of(asked) == Kind.HELLO
                assert len(data) <= len(asked)
                assert target == source
    assert fresh.state is State.LISTENING


def test_a_call_with_proof_of_the_key_is_answered() -> None:
    """Else the laws above would hold for an endpoint that is deaf."""
    endpoint = make_endpoint(Role.RESPONDER)
    endpoint.connect(0.0)
    call = MAGAZINES["calls"][0]
    ((welcome, target),) = answers(endpoint, call, STRANGER, NOW)
    assert kind_of(welcome) == Kind.WELCOME
    assert target == STRANGER
    assert len(welcome) <= len(call)


@examples(40)
@given(
    seed=st.integers(0, 1 << 32),
    means=st.lists(st.sampled_from(["mutated", "random", "forged", "truncated", "handshake"]), min_size=1, max_size=20),
)
def test_nothing_is_answered_without_proof_of_the_key(seed: int, means: list[str]) -> None:
    random = Random(seed)
    fresh = make_endpoint(Role.RESPONDER)
    fresh.connect(0.0)
    for endpoint, now in ((fresh, NOW), (PAIR.slave.endpoint, PAIR.now), (PAIR.master.endpoint, PAIR.now)):
        quiet(endpoint, now)
        for kind in means:
            asked = question(kind, random)
            if asked in SAID:  # a change that changed nothing
                continue
            assert answers(endpoint, asked, random.choice([STRANGER, MASTER, SLAVE]), now) == []


@examples(40)
@given(seed=st.integers(0, 1 << 32), means=st.lists(MEANS, min_size=1, max_size=20), is_stranger=st.booleans())
def test_an_initiator_in_a_session_answers_nobody(seed: int, means: list[str], is_stranger: bool) -> None:
    random = Random(seed)
    endpoint, now = PAIR.master.endpoint, PAIR.now
    quiet(endpoint, now)
    for kind in means:
        assert answers(endpoint, question(kind, random), STRANGER if is_stranger else SLAVE, now) == []
    assert endpoint.state is State.ENGAGED


@examples(10)
@given(seed=st.integers(0, 1 << 32), count=st.integers(1, 300))
def test_played_back_calls_do_not_end_a_session(seed: int, count: int) -> None:
    random = Random(seed)
    pair = Pair(seed=3).engage()
    sessions = pair.slave.sessions
    endpoint, out, back = pair.slave.endpoint, 0, 0
    quiet(endpoint, pair.now)
    for call in random.choices([*MAGAZINES["calls"], *HELLOS], k=count):
        out += len(call)
        back += sum(len(data) for data, _ in answers(endpoint, call, STRANGER, pair.now))
    assert back <= out
    pair.run(0.2)
    assert pair.slave.sessions == sessions
    assert len(pair.master.of(Connected)) == 1
    assert (pair.master.endpoint.state, pair.slave.endpoint.state) == (State.ENGAGED, State.ENGAGED)
