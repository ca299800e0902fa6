"""Two sessions without endpoints: counters near their wrap, single timers."""

from itertools import pairwise
from math import inf
from typing import Any

import pytest

from tests.protocol.harness import by_suite, exchanged, forms, local_end, sample_update
from weberlink.protocol import DropReason, Role, Statistics
from weberlink.protocol.events import PeerClosed, UpdateReceived
from weberlink.protocol.liveness import INTRODUCTIONS, Liveness
from weberlink.protocol.retransmission import RESIDUAL, SHORTEST_PACE
from weberlink.protocol.security import REKEY_AFTER_S, Checksum, Security
from weberlink.protocol.session import Outcome, Session
from weberlink.protocol.wire import PHASE, DirectionLayout, Kind
from weberlink.update import PreviousSample, Update


def sessions(security: Security, first_sequence: int = 1, **changes: Any) -> tuple[Session, Session, Statistics]:
    """Both ends of a session without a round trip, and what the first one counts."""
    ends = [local_end(Role.RESPONDER, outgoing=(forms(3),), **changes) for _ in range(2)]
    first, second = (
        Session(end, protection, 0.0, 0.0, 0.4) for end, protection in zip(ends, exchanged(security), strict=True)
    )
    for session in (first, second):
        session._next_sequence = first_sequence
        session.liveness.agree(0.0, 0.0)
        session.clock.learn(0.0, 0.0, 0.0)
    return first, second, ends[0].statistics


def pair(security: Security, **changes: Any) -> tuple[Session, Session, Statistics]:
    """The same whose ends have introduced themselves."""
    first, second, counted = sessions(security, **changes)
    for _ in range(INTRODUCTIONS + 1):
        exchange(first, second, 0.0)
    return first, second, counted


def deliver(receiver: Session, data: bytes, now: float) -> Outcome:
    outcome = receiver.receive(data, now)
    assert outcome is not DropReason.BAD_TAG
    return outcome


def exchange(sender: Session, receiver: Session, now: float) -> None:
    deliver(receiver, sender.send_heartbeat(now), now)
    deliver(sender, receiver.send_heartbeat(now), now)


@by_suite
def test_a_session_survives_the_wrap_of_its_numbers(security: Security) -> None:
    sender, receiver, counted = pair(security, first_sequence=2**16 - 500)
    for step in range(1000):
        now = step * 0.001
        outcome = deliver(receiver, sender.send_update(now, sample_update(step)), now)
        assert isinstance(outcome, UpdateReceived) and outcome.update.tick == step
        assert deliver(sender, receiver.send_heartbeat(now), now) is None
        assert sender.next_timer(is_encoding=True) > now
    assert counted.lost == counted.repeats == 0


def test_an_update_is_held_once_it_is_acknowledged_whatever_its_number() -> None:
    """The low bits are those of the one before, or 0, which acknowledges nothing."""
    sender, receiver, _ = pair(Checksum(), silence=10.0)
    for tick, number in enumerate((100, 100 + 2**16, 2**17)):
        for passed in range(sender._next_sequence, number, 2**14):
            sender._next_sequence = passed
            exchange(sender, receiver, 0.001 * tick)
        sender._next_sequence = number
        data = sender.send_update(0.001 * tick, sample_update(tick))
        for _ in range(10):  # also acknowledges nothing new
            deliver(sender, receiver.send_heartbeat(0.001 * tick), 0.001 * tick)
        assert sender.liveness.held_until < inf
        deliver(receiver, data, 0.001 * tick)
        deliver(sender, receiver.send_heartbeat(0.001 * tick), 0.001 * tick)
        assert sender.liveness.held_until == inf and not sender.take_lost(0.001 * tick)


@pytest.mark.parametrize(
    ("lag", "extra", "reason"),
    [
        (0, b"", None),
        (0, b"\1", DropReason.MALFORMED),
        (109, b"", None),
        (111, b"", DropReason.STALE),  # the limit, and what an owner's ticks may be late
        (1000, b"", DropReason.STALE),  # tick 0
        (1001, b"", DropReason.IMPLAUSIBLE),
        (-1000, b"", None),
        (-1001, b"", DropReason.IMPLAUSIBLE),
    ],
)
def test_an_update_beyond_its_end_or_of_another_time_is_dropped(
    lag: int, extra: bytes, reason: DropReason | None
) -> None:
    """No owner can send it, a peer with a fault can: bytes too many, a sample of long ago, of the future or below 0."""
    protection, _ = exchanged(Checksum())
    _, receiver, _ = sessions(Checksum())
    now, outcomes = 1.0, []
    for sequence, behind, more in ((1, lag, extra), (2, 0, b"")):
        envelope = (sequence, 0, receiver.clock.stamp(now)[0], Liveness(0.0, 0.1, now, now).echo(now), (None,))
        update = Update(10, 0, (1, 2, 3), PreviousSample(1, (1, 2, 3)))
        clear = DirectionLayout([forms(3)]).updates[0].pack(envelope, behind, update) + more
        outcomes.append(deliver(receiver, protection.seal(sequence, clear, now), now))
    assert outcomes[0] is reason if reason else isinstance(outcomes[0], UpdateReceived)
    assert isinstance(outcomes[1], UpdateReceived)


def test_a_heartbeat_reports_again_once_the_link_has_changed() -> None:
    """The delays rise, and fall back; the least delay falls; losses come, and are forgotten."""
    sender, receiver, _ = pair(Checksum(), silence=10.0)
    now = 0.1

    def reports() -> bool:
        data = receiver.send_heartbeat(now)
        return len(data) > len(receiver.send_heartbeat(now))

    def hear(count: int, delay: float = 0.0, lost: int = 0) -> bool:
        nonlocal now
        for _ in range(count):
            now += 0.001
            for _ in range(lost):
                sender.send_heartbeat(now - delay)
            deliver(receiver, sender.send_heartbeat(now - delay), now)
        return reports()

    assert not reports()
    assert hear(1, delay=0.05) and not reports()
    assert hear(100) and not hear(1)
    assert hear(1, delay=-0.003) and not hear(1, delay=-0.003)
    assert hear(10, delay=-0.003, lost=1) and not reports()
    assert hear(200, delay=-0.003) and not reports()


@pytest.mark.parametrize("loss", [0.0, 0.1])
@pytest.mark.parametrize("allowed", [True, False])
def test_on_a_lossy_link_a_heartbeat_that_is_due_is_the_missing_update_again(loss: float, *, allowed: bool) -> None:
    """No datagram is added, and it is one of the early repeats that are allowed."""
    sender, receiver, counted = pair(Checksum())
    receiver.heartbeats.ask()
    question = receiver.send_heartbeat(0.01)  # leaves before the update can have come, so it is no evidence of a loss
    sender.send_update(0.01, sample_update(10))  # lost
    counted.outgoing_loss = loss
    if not allowed:
        while sender._allowance.left(0.01):
            sender._allowance.pay(0.01)
    now = 0.01 + SHORTEST_PACE
    deliver(sender, question, now)
    answer = sender.handle_timer(now, is_encoding=True)
    assert answer is not None
    assert isinstance(deliver(receiver, answer, now), UpdateReceived) is (allowed and loss > RESIDUAL)
    assert sender.handle_timer(now, is_encoding=True) is None


def test_a_report_that_is_overtaken_changes_nothing() -> None:
    sender, receiver, _ = pair(Checksum(), silence=10.0)
    reports = []
    for now, lost in ((2.0, 5), (4.0, 40)):
        for _ in range(lost):
            sender.send_heartbeat(now)  # is lost
        for _ in range(5):
            deliver(receiver, sender.send_heartbeat(now), now)
        reports.append(receiver.send_heartbeat(now + 1.0))
    deliver(sender, reports[1], 5.0)
    newest = sender._statistics.outgoing_loss
    assert newest > 0.0
    deliver(sender, reports[0], 5.0)
    assert sender._statistics.outgoing_loss == newest


def test_a_farewell_counts_however_late_and_a_wrapped_time_stamp_does_not() -> None:
    """Held back for 2^23 stamps, an update seems to have just left; its number says that it has not."""
    sender, receiver, _ = pair(Checksum(), silence=10.0)
    assert deliver(receiver, sender.send(0.1, Kind.BYE, b"robot: fault"), 40.0) == PeerClosed("robot: fault")
    sender, receiver, _ = pair(Checksum(), silence=10.0)
    wrap, now = 2**23 * 1e-5, 1.0
    held = sender.send_update(now, sample_update(1000))
    while now < 1.0 + wrap:
        exchange(sender, receiver, now)
        now += 0.5
    assert deliver(receiver, held, 1.0 + wrap + 0.001) in (DropReason.IMPLAUSIBLE, DropReason.STALE)


@by_suite
@pytest.mark.parametrize(("period", "rekey_after", "changes"), [(1.0, 2**20, 400 // REKEY_AFTER_S), (0.01, 100, 4)])
def test_keys_are_replaced_by_time_and_by_count_without_a_loss(
    security: Security, period: float, rekey_after: int, changes: int
) -> None:
    """Datagrams of both keys arrive mixed at each change; one that was sealed before it may come after."""
    sender, receiver, counted = pair(security, silence=10.0, rekey_after=rekey_after)
    phases: list[int] = []
    held: list[bytes] = []
    for step in range(1, 400):
        now = step * period
        data = sender.send_update(now, sample_update(round(1000 * now)))
        phases.append(data[0] & PHASE)
        if step % 7 == 0:
            held.append(data)
        else:
            assert isinstance(deliver(receiver, data, now), UpdateReceived)
        if held and step % 7 == 2:
            assert deliver(receiver, held.pop(), now) is DropReason.SUPERSEDED
        assert deliver(sender, receiver.send_heartbeat(now), now) is None
    assert sum(earlier != later for earlier, later in pairwise(phases)) == changes
    changes_at = round(REKEY_AFTER_S) - 1
    assert period < 1.0 or phases[changes_at - 1] != phases[changes_at], "at the very second"
    assert counted.repeats == 0
