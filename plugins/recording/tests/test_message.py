"""The message definition, and the layout that one describes, against an independent encoder."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic

from weberlink.telemetry.message import ENCAPSULATION, SCHEMA_NAME, SCHEMA_TEXT
from weberlink.telemetry.reader import DTYPE
from weberlink_recording.reader import dtype_of

VECTOR = "=" * 80 + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"


def test_it_describes_the_very_layout_of_a_packed_record():
    assert dtype_of(SCHEMA_TEXT) == DTYPE
    assert dtype_of(SCHEMA_TEXT).itemsize == DTYPE.itemsize


NUMBERS = {
    "float64": st.floats(allow_nan=False),
    "float32": st.floats(allow_nan=False, width=32),
    "uint64": st.integers(0, 2**64 - 1),
    "uint8": st.integers(0, 255),
}
NUMBERS["geometry_msgs/Vector3"] = st.fixed_dictionaries(dict.fromkeys("xyz", NUMBERS["float64"]))


@given(st.data())
def test_a_definition_in_any_order_is_read_as_an_independent_encoder_packs_it(data):
    kinds = data.draw(st.lists(st.sampled_from(sorted(NUMBERS)), min_size=1, max_size=12))
    text = "".join(f"{kind} f{index} # [m] 100 % = all\n" for index, kind in enumerate(kinds)) + VECTOR
    message = {f"f{index}": data.draw(NUMBERS[kind]) for index, kind in enumerate(kinds)}
    packed = serialize_dynamic(SCHEMA_NAME, text)[SCHEMA_NAME](message)
    assert packed[:4] == ENCAPSULATION
    layout = dtype_of(text)
    assert layout.itemsize == len(packed) - 4
    row = np.frombuffer(packed[4:], layout)[0]
    for name, value in message.items():
        assert row[name].tolist() == ([value[axis] for axis in "xyz"] if isinstance(value, dict) else value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("string name\n", "field name is of type string, expected one of float64, "),
        ("float64 at\nuint8 at\n", "field at is defined twice"),
        ("float64 at\nuint64\n", "'uint64' is no field"),
        ("# nothing\nuint8 NONE=0\n" + VECTOR, "no field is defined"),
    ],
)
def test_a_definition_that_cannot_be_read_says_why(text, message):
    with pytest.raises(ValueError, match=message):
        dtype_of(text)
