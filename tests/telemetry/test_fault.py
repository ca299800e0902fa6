from hypothesis import given
from hypothesis import strategies as st

from weberlink.telemetry.fault import Fault, FaultLedger

GRAVEST_FIRST = [
    Fault.DEVICE, Fault.TAKEN_OVER, Fault.REFUSED, Fault.STALLED, Fault.TRIPPED, Fault.UNFOUNDED, Fault.UNPROVEN,
    Fault.SILENCE, Fault.UNHEARD, Fault.UPDATE,
]  # fmt: skip
"""What ends a session, then what stops the robot, then what the link does."""
real = st.sampled_from([fault for fault in Fault if fault])


@given(st.lists(st.tuples(st.booleans(), real), max_size=30))
def test_a_fault_is_named_exactly_while_one_lasts(steps: list[tuple[bool, Fault]]) -> None:
    ledger, lasting = FaultLedger(), set()
    for begins, fault in steps:
        if begins:
            ledger.meet(fault)
            lasting.add(fault)
        else:
            ledger.clear(fault)
            lasting.discard(fault)
        assert ledger.active is next((fault for fault in GRAVEST_FIRST if fault in lasting), Fault.NONE)
        assert {each for each in Fault if ledger.has(each)} == lasting
    assert sum(ledger.counts.values()) == sum(begins for begins, _ in steps)


def test_a_note_is_counted_and_does_not_last() -> None:
    ledger = FaultLedger()
    ledger.note(Fault.REFUSED)
    assert (ledger.active, ledger.counts) == (Fault.NONE, {"refused": 1})
