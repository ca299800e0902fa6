"""The table of fields, the layouts that follow from it, the row that makes a record, and the ledger of faults."""

import struct
from itertools import product

import numpy as np
import pytest
from hypothesis import given, strategies as st

from weberlink.telemetry.fault import Fault, FaultLedger
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import ALL, CODES, FIELDS, MOST_AXES, NAMES, RECORD, STREAMS, layout
from weberlink.telemetry.row import Row

KINDS = {
    "<f8": st.floats(allow_nan=False),
    "<f4": st.floats(allow_nan=False, width=32),
    "<u8": st.integers(0, 2**64 - 1),
    "u1": st.integers(0, 255),
}
kinds = [field.kind for field in FIELDS for _ in range(field.axes)]
records = st.tuples(*(KINDS[kind] for kind in kinds))
each_shape = pytest.mark.parametrize("shape", [*product((1, 3, 4, MOST_AXES), range(1, STREAMS + 1))])


@given(records)
def test_numpy_reads_what_struct_packs(record):
    (row,) = np.frombuffer(RECORD.pack(*record), DTYPE)
    assert tuple(value for field in FIELDS for value in np.atleast_1d(row[field.name]).tolist()) == record


@each_shape
def test_each_value_is_aligned_without_padding(shape):
    """However many axes and streams are recorded."""
    dtype, offset = np.dtype(layout(*shape).description), 0
    for field in layout(*shape).fields:
        kind, where = dtype.fields[field.name][:2]
        assert where == offset
        assert where % kind.base.itemsize == 0
        offset += kind.itemsize
    assert offset == dtype.itemsize == struct.calcsize(f"<{layout(*shape).format}")


def test_names_are_unique_and_the_types_of_numpy_and_struct_agree():
    assert len(set(NAMES)) == len(NAMES)
    assert all(np.dtype(numpy).itemsize == struct.calcsize("<" + code) for numpy, code in CODES.items())


@each_shape
def test_a_row_gives_its_values_in_the_order_of_the_fields(shape):
    row, expected, whole = Row(), [], []
    assert ALL.values(row) == (0,) * len(kinds)
    for number, field in enumerate(FIELDS):
        axes = shape[0] if field.axes == MOST_AXES else field.axes
        value = tuple(number + 0.125 * place for place in range(axes)) if field.axes > 1 else number
        setattr(row, field.name, value)
        values = value if field.axes > 1 else [value]
        expected += values if field in layout(*shape).fields else []
        whole += [*values, *[0.0] * (field.axes - axes)]
    assert layout(*shape).values(row) == tuple(expected)
    assert ALL.values(row) == tuple(whole), "what has fewer axes is filled up"


@pytest.mark.parametrize("shape", [(0, 1), (MOST_AXES + 1, 1), (3, 0), (3, STREAMS + 1)])
def test_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match="axes"):
        layout(*shape)


GRAVEST_FIRST = [
    Fault.DEVICE, Fault.TAKEN_OVER, Fault.REFUSED, Fault.STALLED, Fault.TRIPPED, Fault.UNFOUNDED, Fault.UNPROVEN,
    Fault.SILENCE, Fault.UNHEARD, Fault.UNDELIVERED, Fault.UNDELIVERED_SECOND, Fault.UPDATE,
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
    assert sum(ledger.counts.values()) == sum(begins for begins, _ in steps)


def test_a_note_is_counted_and_does_not_last() -> None:
    ledger = FaultLedger()
    ledger.note(Fault.REFUSED)
    assert (ledger.active, ledger.counts) == (Fault.NONE, {"refused": 1})
