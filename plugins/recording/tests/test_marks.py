"""Marks and message definitions in a recording, by our reader and by independent ones."""

import mcap_ros2.decoder
import numpy as np
import pytest
from hypothesis import given, strategies as st
from mcap.reader import make_reader
from mcap_ros2._dynamic import serialize_dynamic

from plugins.recording.tests.records import FACTS, MONOTONIC_S, WALL_S, noise, origin
from tests.records import ticks
from weberlink.protocol.states import State
from weberlink.telemetry.reader import DTYPE
from weberlink_figures.message import ENCAPSULATION, SCHEMA_NAME, SCHEMA_TEXT
from weberlink_recording.configuration import BEGUN, DURING
from weberlink_recording.marks import Mark, pack_mark, read_mark, shortened
from weberlink_recording.reader import dtype_of, read_recording
from weberlink_recording.session import put_together
from weberlink_recording.writer import RecordingWriter

texts = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=40)


@given(st.integers(0, 2**31 * 10**9 - 1), texts)
def test_mark_is_read_as_it_was_packed(wall_ns: int, text: str) -> None:
    assert read_mark(ENCAPSULATION + pack_mark(Mark(wall_ns, text))) == (wall_ns, text)


@given(texts)
def test_shortened_text_is_one_line(text: str) -> None:
    short = shortened(text)
    assert short and "\n" not in short and shortened(short) == short


def test_other_decoders_read_marks(tmp_path) -> None:
    path = tmp_path / "marked.mcap"
    made = [Mark(1_763_700_000_000_000_001 + number, f"mark {number} äöü") for number in range(3)]
    with RecordingWriter.create(path, FACTS) as writer:
        writer.add_side(origin("master"))
        for number, mark in enumerate(made):
            writer.write("master", noise(5, number, first=5 * number))
            writer.mark(mark)
        assert writer.marks == 3
    recording = read_recording(path)
    assert recording.complete and recording.marks == tuple(made) and len(recording.records["master"]) == 15
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[mcap_ros2.decoder.DecoderFactory()])
        found = list(reader.iter_decoded_messages(topics=["/weberlink/marks"]))
    assert [one.decoded_message.msg for one in found] == [mark.text for mark in made]
    first = found[0]
    assert first.schema.name == "rcl_interfaces/msg/Log" and first.message.log_time == made[0].wall_ns
    log = first.decoded_message
    assert (log.stamp.sec, log.stamp.nanosec, log.level, log.name) == (1_763_700_000, 1, 20, "weberlink")


def test_recording_of_a_part_counts_from_its_beginning(tmp_path) -> None:
    path = tmp_path / "part.mcap"
    tick = np.arange(1000)
    made = ticks(1000, start=MONOTONIC_S, tick=tick, state=State.ENGAGED.value, sent=tick % 5 == 0)
    made["updates_sent"] = 7000 + made["sent"].cumsum()
    made["datagrams_sent"] = 9000 + made["tick"]
    with RecordingWriter.create(path, {"bank": FACTS["bank"], BEGUN: DURING}) as writer:
        writer.add_side(origin("slave"))
        writer.write("slave", made)
        writer.mark(Mark(round((WALL_S + 0.25) * 1e9), "here"))
    session = put_together([read_recording(path)])
    figures = session.figures().to_json()
    assert figures["force"]["packets"] == int(made["sent"].sum()) == 200
    assert figures["link"]["sent"] == 999
    (mark,) = session.marks
    assert (round(mark.at, 6), mark.text) == (MONOTONIC_S + 0.25, "here")


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
