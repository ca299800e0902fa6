"""The peer's address when datagrams come from elsewhere: an attacker who copies, a peer that moves."""

from random import Random

from hypothesis import given, strategies as st

from tests.protocol.harness import Pair, Side, kind_of
from weberlink.protocol import Address, Connected, State
from weberlink.protocol.address import OVERTAKEN, AddressCheck
from weberlink.protocol.wire import Kind
from weberlink.update import Update

HOME: Address = ("192.0.2.1", 40_000)
ELSEWHERE: Address = ("203.0.113.9", 9)
QUIET = 0.02


def at_home() -> AddressCheck:
    check = AddressCheck(HOME, Random(1).randbytes, QUIET)
    check.on_datagram(HOME, 0.0, is_fresh=True)
    assert check.challenge(0.0) is None
    return check


@given(st.lists(st.floats(1e-4, 0.05), min_size=1, max_size=200), st.floats(1e-5, QUIET))
def test_copies_never_move_the_address(gaps: list[float], ahead: float) -> None:
    """Every copy comes first, its original follows; the attacker even answers the challenge."""
    check, now = at_home(), 0.0
    for gap in gaps:
        now += gap
        check.on_datagram(ELSEWHERE, now, is_fresh=True)
        if (challenge := check.challenge(now)) is not None:
            check.on_answer(challenge[0], now)
        check.on_datagram(HOME, now + min(ahead, 0.9 * gap), is_fresh=False)
        assert check.address == HOME


@given(st.floats(1e-3, 0.05))
def test_peer_that_moved_is_followed_once_it_has_answered(gap: float) -> None:
    check, now, steps = at_home(), 0.0, 0
    while check.address == HOME:
        now, steps = now + gap, steps + 1
        check.on_datagram(ELSEWHERE, now, is_fresh=True)
        if (challenge := check.challenge(now)) is not None:
            assert challenge[1] == ELSEWHERE
            check.on_answer(challenge[0], now)
    assert steps >= OVERTAKEN
    assert now <= max(OVERTAKEN + 1, QUIET / gap + 2) * gap


def test_attacker_who_copies_datagrams_gets_only_challenges() -> None:
    """Every datagram of the master also arrives earlier, from the attacker's address, from the first one on."""

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for side, values in ((pair.master, 3), (pair.slave, 6)):
            if side.endpoint.sessions and tick % 7 == 0:
                side.endpoint.send_update(now, Update(tick, 0, (tick % 100,) * values))

    def race(side: Side, data: bytes) -> bool:
        if side is pair.master and kind_of(data) != Kind.HELLO:
            pair.slave.endpoint.receive_datagram(data, ELSEWHERE, pair.now)
        return False

    pair = Pair(on_tick=on_tick)
    pair.swallow = race
    pair.connect().run(2.0)
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert pair.slave.endpoint.peer == HOME
    assert len(pair.slave.of(Connected)) == 1
    assert {kind for target, kind in pair.sent_to if target == ELSEWHERE} <= {Kind.PATH}


def test_only_the_token_proves_an_address_and_the_present_one_must_be_quiet() -> None:
    check = at_home()
    for step in range(1, 6):
        check.on_datagram(ELSEWHERE, 0.001 * step, is_fresh=True)
    challenge = check.challenge(0.005)
    assert challenge is not None
    check.on_answer(b"another", 0.5)
    assert check.address == HOME
    check.on_answer(challenge[0], 0.9 * QUIET)
    assert check.address == HOME
    check.on_datagram(ELSEWHERE, 1.1 * QUIET, is_fresh=True)
    assert check.address == ELSEWHERE
