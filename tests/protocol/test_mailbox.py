from weberlink.protocol import DropReason, Statistics
from weberlink.protocol.events import ChangeProposed, Connected, DatagramDropped, PeerSilent, Refused
from weberlink.protocol.mailbox import QUEUED_DATAGRAMS, QUEUED_EVENTS, Mailbox

BEGUN = Connected(("h", 1), {})


def test_datagrams_leave_in_order_and_once_and_the_oldest_are_dropped() -> None:
    statistics = Statistics()
    mailbox = Mailbox(statistics)
    mailbox.post(b"a", ("h", 1))
    mailbox.post(b"bc", ("h", 2))
    assert mailbox.datagrams() == [(b"a", ("h", 1)), (b"bc", ("h", 2))]
    assert mailbox.datagrams() == []
    mailbox.count(b"abcd")
    mailbox.count(b"e")
    assert (statistics.sent, statistics.bytes_sent) == (2, 3)
    assert (statistics.received, statistics.bytes_received) == (2, 5)
    for number in range(QUEUED_DATAGRAMS + 3):
        mailbox.post(bytes([number]), ("h", 1))
    assert mailbox.datagrams()[0][0] == b"\x03"
    assert statistics.overflowed == 3


def test_a_flood_of_drops_pushes_no_other_event_out() -> None:
    statistics = Statistics()
    mailbox = Mailbox(statistics)
    mailbox.tell(PeerSilent(is_heard=False))
    for _ in range(10_000):
        mailbox.drop(DropReason.BAD_TAG)
    mailbox.tell(Refused("no"))
    events = []
    while (event := mailbox.next_event()) is not None:
        events.append(event)
    assert events[0] == PeerSilent(is_heard=False)
    assert events[-1] == Refused("no")
    assert len(events) < QUEUED_EVENTS
    assert DatagramDropped(DropReason.BAD_TAG) in events
    assert statistics.dropped == {DropReason.BAD_TAG: 10_000}


def test_a_session_begins_with_an_empty_queue() -> None:
    mailbox = Mailbox(Statistics())
    mailbox.tell(ChangeProposed(5, b"of the session before"))
    mailbox.begin(BEGUN)
    mailbox.tell(ChangeProposed(5, b"of this one"))
    assert mailbox.next_event() == BEGUN
    assert mailbox.next_event() == ChangeProposed(5, b"of this one")
    assert mailbox.next_event() is None
    for number in range(QUEUED_EVENTS + 5):
        mailbox.tell(Refused(str(number)))
    assert mailbox.next_event() == Refused("5")
