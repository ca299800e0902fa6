"""Changes that both ends make at the same tick, and the round trip that they agree on."""

from math import inf

import pytest
from hypothesis import example, given, strategies as st

from tests.protocol.harness import ENGAGED, SILENCE, TICK, Pair, both, make_endpoint, states
from weberlink.protocol import ChangeAnswered, ChangeProposed, Connected, DropReason, PeerSilent, Refused, Role, State
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.liveness import DEAF, Liveness
from weberlink.protocol.negotiation import (
    ACCEPTED,
    FALL_AFTER,
    NUMBERS,
    STEP,
    SWITCH_AHEAD,
    Negotiation,
    RoundTripAgreement,
    rounded_up,
)
from weberlink.protocol.wire import LONGEST_CHANGE
from weberlink.update import Update

BODY = b'{"weber":0.2}'


def propose(pair: Pair, body: bytes = BODY, ahead: int = 500) -> int:
    tick = pair.ticks + ahead
    assert pair.master.endpoint.propose_change(pair.master.local(pair.now), tick, body)
    return tick


def test_one_proposal_at_a_time() -> None:
    pair = Pair().engage()
    for body in (b"", b"x" * (LONGEST_CHANGE + 1)):
        with pytest.raises(ValueError, match=f"1 to {LONGEST_CHANGE} bytes"):
            propose(pair, body)
    for number in range(40):  # more than there are numbers
        body = b"%d" % number
        tick = propose(pair, body)
        assert not pair.master.endpoint.propose_change(pair.now, 10, BODY)
        pair.run(0.02)
        assert pair.slave.of(ChangeProposed)[-1] == ChangeProposed(tick, body)
        pair.slave.endpoint.answer_change(pair.slave.of(ChangeProposed)[-1], None)
        pair.run(0.02)
        assert pair.master.of(ChangeAnswered)[-1] == ChangeAnswered(tick, body, None)


def test_only_a_new_proposal_is_told_and_only_the_present_one_answered() -> None:
    negotiation, former = Negotiation(), None
    for number in range(1, 3 * NUMBERS):
        proposal = negotiation.on_proposal(number % NUMBERS, 100 + number, BODY, 0.0)
        assert proposal is not None
        if former is not None:
            negotiation.answer(former, None)
            assert negotiation.due == inf
        negotiation.answer(proposal, "busy")
        assert negotiation.due == -inf and (negotiation.take(0.0, 0.0) or BODY)[0] == number % NUMBERS
        former = proposal
        for past in range(1, min(number, NUMBERS - 2)):
            assert negotiation.on_proposal((number - past) % NUMBERS, 100 + number - past, BODY, 0.0) is None


def test_only_an_answer_to_the_present_proposal_counts_once() -> None:
    negotiation = Negotiation()
    assert negotiation.on_answer(3, b"\x01", 0.0) is None
    negotiation.propose(10, BODY, 0.0)
    assert negotiation.on_answer(7, b"\x01", 0.0) is None
    assert negotiation.on_answer(1, b"", 0.0) is None
    assert negotiation.on_answer(1, b"\x01", 0.0) == ChangeAnswered(10, BODY, None)
    assert negotiation.on_answer(1, b"\x00late", 0.0) is None


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
    assert pair.slave.endpoint.sessions == 2
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


# --- the round trip


def over(delay: float, **changes: object) -> Pair:
    return Pair(link=Emulation(delay_s=delay), **both(**changes))


def agreed(pair: Pair) -> list[float]:
    return [side.endpoint.liveness.round_trip for side in pair.sides]


@given(st.floats(0.0, 0.2))
@example(0.0)
@example(0.2)
def test_both_ends_begin_with_the_round_trip_of_the_handshake(delay: float) -> None:
    pair = over(delay).connect().run(3.2 * delay + 0.01)
    assert states(pair) == ENGAGED
    least = rounded_up(2.0 * delay)
    assert agreed(pair) == pytest.approx([min(least, 0.4)] * 2, abs=STEP)
    pair.run(5.0)
    assert not any(side.of(PeerSilent) for side in pair.sides)
    assert [len(side.of(Connected)) for side in pair.sides] == [1, 1]


def test_an_opening_session_drives_nothing_until_something_was_confirmed() -> None:
    """On a long path; updates arrive before the first confirmation can."""
    seen = [0, 0]

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for place, side in enumerate(pair.sides):
            liveness, is_driven = side.endpoint.liveness, side.endpoint.may_follow(now)
            assert not (liveness.is_opening and is_driven)
            seen[0] += liveness.is_opening and now <= liveness.encodes_until
            seen[1] += is_driven
            if side.endpoint.state is State.ENGAGED and tick % 10 == 0:
                side.endpoint.send_update(now, Update(tick, 0, (tick % 100,) * (3, 6)[place]))

    Pair(link=Emulation(delay_s=0.15), on_tick=on_tick).connect().run(2.0)
    assert min(seen) > 0


@pytest.mark.parametrize(("own", "other"), [(0.4, 0.4), (0.3, 2.0), (2.0, 0.3)])
def test_a_link_beyond_the_smaller_limit_never_engages_and_both_ends_say_why(own: float, other: float) -> None:
    limits = {"master": {"longest_round_trip": own}, "slave": {"longest_round_trip": other}}
    pair = Pair(link=Emulation(delay_s=0.23), **limits)
    pair.connect().run(5.0)
    said = [side.of(Refused)[0] for side in pair.sides]
    assert said[0] == said[1]
    assert "460 ms" in said[0].message and f"{min(own, other) * 1e3:g}" in said[0].message
    assert not any(side.of(Connected) for side in pair.sides)
    assert states(pair) == [State.CLOSED, State.LISTENING]


def test_a_link_that_was_short_enough_once_is_called_again_for_ever() -> None:
    pair = over(0.05).engage()
    pair.forward = pair.backward = pair.link(Emulation(delay_s=0.3))
    pair.run(20.0)
    assert pair.master.endpoint.state is State.CONNECTING
    assert not any(side.of(Refused) for side in pair.sides)
    pair.forward = pair.backward = pair.link(Emulation(delay_s=0.05))
    pair.run(1.0)
    assert states(pair) == ENGAGED


def test_it_rises_with_the_link_and_falls_slowly_without_an_interruption() -> None:
    pair = over(0.01).engage().run(2.0)
    for delay in [0.001 * milliseconds for milliseconds in range(13, 61, 3)]:
        for link in (pair.forward, pair.backward):
            link.change(Emulation(delay_s=delay))  # and loses nothing that is under way
        pair.run(3.0)
        assert agreed(pair)[0] == agreed(pair)[1]
        assert 2.0 * delay <= agreed(pair)[0] <= 2.0 * delay + 0.03
    risen = agreed(pair)[0]
    for link in (pair.forward, pair.backward):
        link.change(Emulation(delay_s=0.01))
    pair.run(FALL_AFTER - 1.5)  # a report comes once a second
    assert agreed(pair) == [risen] * 2
    pair.run(FALL_AFTER)
    assert agreed(pair)[0] == agreed(pair)[1] >= 0.5 * risen
    pair.run(6.0 * FALL_AFTER)
    assert agreed(pair)[0] == agreed(pair)[1] <= 0.06
    assert not any(side.of(PeerSilent) for side in pair.sides)


def test_it_never_exceeds_what_the_user_allows() -> None:
    """Somebody on the path holds datagrams back for longer and longer."""
    pair = Pair(**both(longest_round_trip=0.1)).engage()
    for delay in (0.02, 0.04, 0.06, 0.08, 0.1):
        pair.forward = pair.backward = pair.link(Emulation(delay_s=delay))
        pair.run(2.0)
        assert max(agreed(pair)) <= 0.1
    assert State.ENGAGED not in states(pair)


def test_next_value_waits_until_no_datagram_of_the_one_before_counts() -> None:
    """The two values in use are told apart by their parity alone."""
    liveness = Liveness(0.0, SILENCE, 0.0, 0.0)
    liveness.agree(0.02, 0.0)
    agreement = RoundTripAgreement(liveness, 0.4, TICK, proposes=True)

    def proposes(needed: float, now: float) -> bool:
        agreement.on_needed(needed, now, now)
        return agreement.is_proposing

    assert not proposes(0.05, SILENCE) and not proposes(0.015, 1.0)
    assert proposes(0.05, 1.0) and agreement.switch_at == inf
    agreement.on_answer(agreement.take(1.0, 0.0)[0], ACCEPTED, 1.1)
    assert not agreement.advance(1.149) and agreement.advance(1.0 + 2.0 * 0.05 + SWITCH_AHEAD)
    assert liveness.round_trip == pytest.approx(0.05)
    assert not proposes(0.2, 2.0), "the other end has not switched yet"
    liveness.hear(2.0, DEAF, 1, 2.0)
    assert not proposes(0.2, 2.0 + SILENCE + 0.049)
    assert proposes(0.2, 2.0 + SILENCE + 0.051)
