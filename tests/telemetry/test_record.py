"""The table and the layouts that follow from it."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.telemetry.link import COUNTERS
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import AXES, CODES, COLUMNS, FIELDS, RECORD, Record

KINDS = {
    "<f8": st.floats(allow_nan=False),
    "<f4": st.floats(allow_nan=False, width=32),
    "<u8": st.integers(0, 2**64 - 1),
    "u1": st.integers(0, 255),
}
kinds = [field.kind for field in FIELDS for _ in range(field.axes)]
records = st.tuples(*(KINDS[kind] for kind in kinds)).map(Record._make)


def test_the_struct_and_the_numpy_type_have_the_same_size():
    assert RECORD.size == DTYPE.itemsize == 354


def test_the_named_tuple_has_the_columns_of_the_table_in_order():
    assert Record._fields == COLUMNS
    assert len(set(COLUMNS)) == len(COLUMNS)


@given(records)
def test_what_struct_packs_numpy_reads_field_by_field(record):
    (row,) = np.frombuffer(RECORD.pack(*record), DTYPE)
    for field in FIELDS:
        if field.axes == 3:
            assert row[field.name].tolist() == [getattr(record, f"{field.name}_{axis}") for axis in AXES]
        else:
            assert row[field.name].item() == getattr(record, field.name)


def test_there_is_no_padding_and_each_value_lies_on_its_own_boundary():
    offset = 0
    for field in FIELDS:
        kind, where = DTYPE.fields[field.name][:2]
        assert where == offset
        assert where % kind.base.itemsize == 0
        offset += kind.itemsize
    assert offset == DTYPE.itemsize


def test_both_names_of_each_type_mean_the_same():
    for numpy_name, struct_name in CODES.items():
        assert np.dtype(numpy_name).itemsize == struct.calcsize("<" + struct_name)


def test_what_the_link_counts_stands_together_in_its_order():
    first = COLUMNS.index(COUNTERS[0])
    assert COLUMNS[first : first + len(COUNTERS)] == COUNTERS


def test_units_and_meanings_are_written_down():
    assert all(field.meaning and field.axes in (1, 3) for field in FIELDS)
    assert all(field.unit == "us" for field in FIELDS if field.name.endswith("_us"))


@pytest.mark.parametrize(("column", "value"), [("state", 256), ("tick", -1), ("clipped", 0.5)])
def test_a_value_that_does_not_fit_is_an_error_of_the_writer(column, value):
    values = dict.fromkeys(COLUMNS, 0) | {column: value}
    with pytest.raises(struct.error):
        RECORD.pack(*Record(**values))
