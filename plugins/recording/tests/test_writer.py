"""What is in the file: round trips, an independent decoder, the library's own reader, and disks that are full."""

import errno
import resource
from contextlib import contextmanager

import mcap_ros2.decoder
import numpy as np
import pytest
from hypothesis import given, strategies as st
from mcap.reader import make_reader

from plugins.recording.tests.records import FACTS, MONOTONIC_S, SIDES, WALL_S, noise, origin, same, small_file
from tests.examples import examples
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import FIELDS
from weberlink_figures.message import ENCAPSULATION, SCHEMA_NAME
from weberlink_recording.container import END, FACTS as FACTS_NAME
from weberlink_recording.reader import read_recording
from weberlink_recording.writer import CHUNK_RECORDS, Origin, RecordingWriter


@pytest.fixture
def path(tmp_path):
    return tmp_path / "session.mcap"


@examples(30)
@given(
    sizes=st.lists(st.tuples(st.sampled_from(SIDES), st.integers(0, 30), st.booleans()), max_size=12),
    seed=st.integers(0, 2**32 - 1),
    odd=st.sampled_from([None, np.nan, np.inf, -np.inf, 1e308, -1e308, 0.0]),
)
def test_what_was_written_is_read_bit_for_bit(tmp_path_factory, sizes, seed, odd):
    """Whatever its times are."""
    path = tmp_path_factory.mktemp("round") / "trip.mcap"
    written = {side: [noise(0, 0)] for side in SIDES}
    with RecordingWriter.create(path, FACTS) as writer:
        for side in SIDES:
            writer.add_side(origin(side))
        for index, (side, count, flush) in enumerate(sizes):
            written[side].append(noise(count, seed + index, sum(map(len, written[side]))))
            if odd is not None:
                written[side][-1]["at"][::3] = odd
            writer.write(side, written[side][-1])
            if flush:
                writer.flush()
    recording = read_recording(path)
    assert (recording.complete, recording.outcome, recording.facts) == (True, "complete", FACTS)
    assert recording.lost == dict.fromkeys(SIDES, 0)
    for side in SIDES:
        assert recording.origins[side] == origin(side)
        assert recording.records[side].dtype == DTYPE
        assert same(recording.records[side], np.concatenate(written[side]))


def decoded(message, field):
    value = getattr(message, field.name)
    return value if field.axes == 1 else list(value)


def test_an_independent_decoder_yields_the_same_values_field_by_field(path):
    written = small_file(path)
    seen = dict.fromkeys(SIDES, 0)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[mcap_ros2.decoder.DecoderFactory()])
        for schema, channel, message, tick in reader.iter_decoded_messages():
            side = channel.topic.removeprefix("/weberlink/")
            record = written[side][seen[side]]
            assert schema.name == SCHEMA_NAME
            assert message.sequence == seen[side]
            for field in FIELDS:
                assert np.array_equal(decoded(tick, field), record[field.name], equal_nan=field.kind.startswith("<f"))
            seen[side] += 1
    assert seen == {side: len(records) for side, records in written.items()}


def test_the_library_accepts_the_file_with_every_checksum_and_count(path):
    written = small_file(path)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        times = [message.log_time for *_, message in reader.iter_messages(log_time_order=False)]
        assert times == sorted(times)
        for *_, message in reader.iter_messages():
            (at,) = np.frombuffer(message.data[len(ENCAPSULATION) :], DTYPE)["at"]
            assert message.log_time == message.publish_time
            assert message.log_time == round(WALL_S * 1e9) + round((at - MONOTONIC_S) * 1e9)
        counts = {f"records_{side}": str(len(records)) for side, records in written.items()}
        assert {record.name: record.metadata for record in reader.iter_metadata()} == {
            FACTS_NAME: FACTS,
            END: {"outcome": "complete"} | counts | {f"lost_{side}": "0" for side in SIDES},
        }
        summary = reader.get_summary()
    statistics = summary.statistics
    assert statistics.channel_message_counts == {1: len(written["master"]), 2: len(written["slave"])}
    assert statistics.message_count == len(times) == sum(map(len, written.values()))
    assert (statistics.chunk_count, statistics.channel_count, statistics.schema_count) == (4, 2, 1)
    assert (statistics.message_start_time, statistics.message_end_time) == (times[0], times[-1])


def test_what_is_flushed_is_in_the_file_and_what_waits_is_bounded(path):
    with RecordingWriter.create(path, FACTS) as writer:
        writer.add_side(origin("master"))
        writer.write("master", noise(10, 1))
        assert len(read_recording(path).records["master"]) == 0
        writer.flush()
        assert len(read_recording(path).records["master"]) == 10
        writer.write("master", noise(CHUNK_RECORDS, 2, first=10))
        assert len(read_recording(path).records["master"]) == 10 + CHUNK_RECORDS
        assert writer.records == {"master": 10 + CHUNK_RECORDS}
        recording = read_recording(path)
        assert (recording.complete, recording.outcome, recording.facts) == (False, "cut off", FACTS)
        assert writer.size == path.stat().st_size
    assert writer.size == path.stat().st_size


def test_a_recording_that_failed_says_so_and_what_is_lost(path):
    def fail():
        raise RuntimeError("the scene exploded")

    with pytest.raises(RuntimeError), RecordingWriter.create(path, {}) as writer:
        writer.add_side(origin("slave"))
        writer.write("slave", noise(5, 1))
        writer.note_lost("slave", 3)
        writer.note_lost("slave", 4)
        fail()
    recording = read_recording(path)
    assert (recording.complete, recording.outcome) == (False, "failed: the scene exploded")
    assert (len(recording.records["slave"]), recording.lost) == (5, {"slave": 7})


def test_wrong_use_is_named(path):
    with RecordingWriter.create(path, {}) as writer:
        writer.add_side(origin("master"))
        with pytest.raises(ValueError, match="master is recorded already"):
            writer.add_side(origin("master"))
        with pytest.raises(ValueError, match="one of master, slave, got 'robot'"):
            writer.add_side(Origin("robot", 1.0, 0.0, 0.0))
        with pytest.raises(ValueError, match="'slave' was not added"):
            writer.write("slave", noise(1, 1))
        with pytest.raises(ValueError, match="other fields"):
            writer.write("master", np.zeros(3, [("at", "<f8")]))
    with pytest.raises(ValueError, match="is closed"):
        writer.write("master", noise(1, 1))
    writer.close()


@contextmanager
def room(size):
    """No file grows beyond that."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        with pytest.raises(OSError, match="too large") as error:
            yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert error.value.errno == errno.EFBIG


@pytest.mark.parametrize(
    ("left", "outcome"), [(400, "File too large"), (10, "cut off")], ids=["for an end, not for the index", "for no end"]
)
def test_with_little_room_the_file_is_a_row_of_whole_chunks(path, left, outcome):
    writer = RecordingWriter.create(path, FACTS)
    writer.add_side(origin("master"))
    writer.write("master", noise(5, 1))
    writer.flush()
    size = writer.size
    with room(size + left):
        writer.write("master", noise(500, 2, first=5))
        writer.flush()
    with pytest.raises(OSError, match="too large"):
        writer.write("master", noise(1, 1))
    writer.close()
    recording = read_recording(path)
    assert (len(recording.records["master"]), recording.complete, recording.outcome) == (5, False, outcome)
    if outcome == "cut off":
        assert path.stat().st_size == size
        return
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_summary() is None
        assert len(list(reader.iter_messages())) == 5


def test_without_room_for_an_end_or_a_beginning_it_is_said_and_all_is_read(path):
    writer = RecordingWriter.create(path, FACTS)
    writer.add_side(origin("master"))
    writer.write("master", noise(5, 1))
    writer.flush()
    with room(writer.size + 10):
        writer.close()
    writer.close()
    recording = read_recording(path)
    assert (len(recording.records["master"]), recording.outcome) == (5, "cut off")
    other = path.with_name("other.mcap")
    with room(20):
        RecordingWriter.create(other, FACTS)
    assert not other.exists()
