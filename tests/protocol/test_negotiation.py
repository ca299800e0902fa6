"""Changes that both ends make at the same tick, over links that lose proposals and answers."""

from math import inf

import pytest

from tests.protocol.harness import Pair, make_endpoint
from weberlink.protocol import ChangeAnswered, ChangeProposed, DropReason, Role
from weberlink.protocol.negotiation import NUMBERS, Negotiation
from weberlink.protocol.wire import LONGEST_CHANGE

BODY = b'{"weber":0.2}'


def propose(pair: Pair, body: bytes = BODY, ahead: int = 500) -> int:
    """The master proposes a change; returns its tick."""
    tick = pair.ticks + ahead
    assert pair.master.endpoint.propose_change(pair.master.local(pair.now), tick, body)
    return tick


def test_one_proposal_at_a_time() -> None:
    pair = Pair().engage()
    for body in (b"", b"x" * (LONGEST_CHANGE + 1)):
        with pytest.raises(ValueError, match=f"1 to {LONGEST_CHANGE} bytes"):
            propose(pair, body)
    propose(pair)
    assert not pair.master.endpoint.propose_change(pair.now, 10, BODY)
    pair.run(0.02)
    pair.slave.endpoint.answer_change(pair.slave.of(ChangeProposed)[0], None)
    pair.run(0.02)
    for number in range(40):  # more than there are numbers
        body = b"%d" % number
        tick = propose(pair, body)
        pair.run(0.02)
        assert pair.slave.of(ChangeProposed)[-1] == ChangeProposed(tick, body)
        pair.slave.endpoint.answer_change(pair.slave.of(ChangeProposed)[-1], None)
        pair.run(0.02)
        assert pair.master.of(ChangeAnswered)[-1] == ChangeAnswered(tick, body, None)


def test_only_a_new_proposal_is_told_and_only_the_present_one_answered() -> None:
    negotiation = Negotiation()
    for number in range(1, 3 * NUMBERS):
        proposal = negotiation.on_proposal(number % NUMBERS, 100 + number, BODY)
        assert proposal is not None
        negotiation.answer(proposal, None)
        for past in range(1, min(number, NUMBERS - 2)):
            assert negotiation.on_proposal((number - past) % NUMBERS, 100 + number - past, BODY) is None
    negotiation = Negotiation()
    first, second = (negotiation.on_proposal(number, 100 * number, BODY) for number in (1, 2))
    assert first is not None and second is not None
    negotiation.answer(first, None)
    assert negotiation.due == inf
    negotiation.answer(second, "busy")
    assert negotiation.due == -inf
    assert negotiation.take(0.0, 0.0)[0] == 2


def test_only_an_answer_to_the_present_proposal_counts_once() -> None:
    negotiation = Negotiation()
    assert negotiation.on_answer(3, b"\x01") is None
    negotiation.propose(10, BODY, 0.0)
    assert negotiation.on_answer(7, b"\x01") is None
    assert negotiation.on_answer(1, b"") is None
    assert negotiation.on_answer(1, b"\x01") == ChangeAnswered(10, BODY, None)
    assert negotiation.on_answer(1, b"\x00late") is None


@pytest.mark.parametrize("rtt", [0.0, 0.005, 0.1, 1.0])
def test_repeats_do_not_wait_for_an_answer(rtt: float) -> None:
    negotiation = Negotiation()
    negotiation.propose(10, BODY, 0.0)
    sent, now = 0, 0.0
    while now <= max(0.01, rtt):
        now = negotiation.due
        negotiation.take(now, rtt)
        sent += 1
    assert 5 <= sent <= 12


def test_a_proposal_is_answered_in_its_own_session_alone() -> None:
    """Its event may be read, or still be held, when another session has begun."""
    pair = Pair().engage()
    propose(pair)
    pair.run(0.02)
    (held,) = pair.slave.of(ChangeProposed)
    pair.master.endpoint.close(pair.master.local(pair.now), "bye")
    pair.run(0.01)
    pair.master.endpoint = make_endpoint(Role.INITIATOR, seed=2)
    pair.master.endpoint.connect(pair.master.local(pair.now))
    pair.run(0.2)
    assert pair.slave.sessions == 2
    pair.slave.endpoint.answer_change(held, None)
    tick = propose(pair)
    pair.run(0.02)
    assert not pair.master.of(ChangeAnswered), "the answer to the former one would be taken for that of this one"
    pair.slave.endpoint.answer_change(pair.slave.of(ChangeProposed)[-1], None)
    pair.run(0.02)
    assert pair.master.of(ChangeAnswered) == [ChangeAnswered(tick, BODY, None)]


@pytest.mark.parametrize(("ahead", "is_told"), [(-30_100, False), (-29_900, True), (29_900, True), (30_100, False)])
def test_change_too_far_ahead_or_back_is_dropped(ahead: int, is_told: bool) -> None:
    pair = Pair(master={"epoch": -100.0}).engage()
    assert pair.master.endpoint.propose_change(pair.now, 100_000 + pair.ticks + ahead, BODY)
    pair.run(0.05)
    assert bool(pair.slave.of(ChangeProposed)) is is_told
    assert is_told or set(pair.slave.faults()) == {DropReason.IMPLAUSIBLE}
