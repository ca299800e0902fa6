"""The table of fields, the layouts that follow from it, and the row that makes a record."""

import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import AXES, CODES, COLUMNS, FIELDS, JOINTS, RECORD, Record
from weberlink.telemetry.row import Row

KINDS = {
    "<f8": st.floats(allow_nan=False),
    "<f4": st.floats(allow_nan=False, width=32),
    "<u8": st.integers(0, 2**64 - 1),
    "u1": st.integers(0, 255),
}
kinds = [field.kind for field in FIELDS for _ in range(field.axes)]
records = st.tuples(*(KINDS[kind] for kind in kinds)).map(Record._make)


@given(records)
def test_numpy_reads_what_struct_packs(record):
    (row,) = np.frombuffer(RECORD.pack(*record), DTYPE)
    for field in FIELDS:
        if field.axes > 1:
            places = AXES if field.axes == 3 else JOINTS
            assert row[field.name].tolist() == [getattr(record, f"{field.name}_{place}") for place in places]
        else:
            assert row[field.name].item() == getattr(record, field.name)


def test_each_value_is_aligned_without_padding():
    offset = 0
    for field in FIELDS:
        kind, where = DTYPE.fields[field.name][:2]
        assert where == offset
        assert where % kind.base.itemsize == 0
        offset += kind.itemsize
    assert offset == DTYPE.itemsize == RECORD.size
    assert len(set(COLUMNS)) == len(COLUMNS)
    assert all(np.dtype(numpy).itemsize == struct.calcsize("<" + code) for numpy, code in CODES.items())


def test_a_row_gives_its_values_in_the_order_of_the_fields():
    row, expected = Row(), []
    assert row.values() == (0,) * len(COLUMNS)
    for number, field in enumerate(FIELDS):
        value = tuple(number + 0.125 * place for place in range(field.axes)) if field.axes > 1 else number
        assert np.shape(getattr(row, field.name)) == np.shape(value)
        setattr(row, field.name, value)
        expected += value if field.axes > 1 else [value]
    assert row.values() == tuple(expected)
