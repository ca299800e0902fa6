"""Reading: files that are cut, damaged, rewritten, of another release, or no recording at all."""

import struct

import numpy as np
import pytest
from mcap.records import Chunk, DataEnd, Schema
from mcap.writer import CompressionType

from plugins.recording.tests.records import FACTS, SIDES, frames_of, noise, origin, same, small_file, write_elsewhere
from weberlink.telemetry.reader import DTYPE
from weberlink_figures.message import SCHEMA_TEXT
from weberlink_recording.reader import RecordingError, dtype_of, read_recording


@pytest.fixture
def path(tmp_path):
    return tmp_path / "session.mcap"


def error_of(path):
    with pytest.raises(RecordingError) as error:
        read_recording(path)
    text = str(error.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    return text


def test_at_every_byte_what_is_read_is_the_beginning_of_what_was_written(path, tmp_path):
    written = small_file(path, pieces=2, each=1)
    data = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    steps = set()
    for size in dense(data):
        cut.write_bytes(data[:size])
        try:
            recording = read_recording(cut)
        except RecordingError as error:
            assert str(error).startswith(f"{cut}: ") and "\n" not in str(error)
            steps.add("nothing")
            continue
        assert (recording.complete, recording.outcome) == (False, "cut off")
        assert recording.facts == FACTS
        for side, records in recording.records.items():
            assert recording.origins[side] == origin(side)
            assert same(records, written[side][: len(records)])
        steps.add(tuple(map(len, recording.records.values())))
    assert steps == {"nothing", (0,), (0, 0), (1, 1), (2, 2)}


def places(data, kind):
    """Where the frames of a kind begin."""
    found, at = [], 8
    for frame in frames_of(data):
        if isinstance(frame, kind):
            found.append(at)
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return found


def dense(data):
    """Every seventh place in a file, and every sixtieth of the long text of a schema."""
    schemas = [range(at + 60, at + len(SCHEMA_TEXT)) for at in places(data, Schema)]
    return [at for at in range(len(data)) if at % 60 == 0 or (at % 7 == 0 and not any(at in each for each in schemas))]


def test_a_changed_byte_never_passes_for_a_whole_recording(path, tmp_path):
    written = small_file(path, pieces=2, each=1)
    data = path.read_bytes()
    (end,) = places(data, DataEnd)
    changed = tmp_path / "changed.mcap"
    for at in (at for at in dense(data) if at < end):
        changed.write_bytes(data[:at] + bytes([data[at] ^ (1 << at % 8)]) + data[at + 1 :])
        try:
            recording = read_recording(changed)
        except RecordingError as error:
            assert str(error).startswith(f"{changed}: ") and "\n" not in str(error)
            continue
        assert not recording.complete
        for side, records in recording.records.items():
            assert len(records) <= len(written[side])
            if records.dtype == DTYPE:
                assert {record.tobytes() for record in records} <= {record.tobytes() for record in written[side]}


def test_what_comes_before_a_changed_chunk_is_kept(path):
    written = small_file(path)
    data = bytearray(path.read_bytes())
    data[places(data, Chunk)[2] + 60] ^= 0x10
    path.write_bytes(data)
    recording = read_recording(path)
    assert not recording.complete
    assert recording.outcome.startswith("damaged: a chunk that does not unpack")
    assert "\n" not in recording.outcome
    for side in SIDES:
        assert same(recording.records[side], written[side][:10])


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_messages_one_by_one_between_others_are_the_same(path, compression, chunked):
    written = {side: noise(60, seed) for seed, side in enumerate(SIDES)}
    shuffled = {side: records[np.random.default_rng(1).permutation(60)] for side, records in written.items()}
    write_elsewhere(path, shuffled, compression=compression, chunked=chunked)
    recording = read_recording(path)
    for side in SIDES:
        assert same(recording.records[side], written[side])
    assert (recording.complete, recording.facts, recording.lost) == (False, {}, {})


def test_a_field_more_and_a_field_less_are_read_by_name(path):
    lines = SCHEMA_TEXT.splitlines(keepends=True)
    text = "".join(line for line in lines if " predicted " not in line)
    text = text.replace("float64 peer_at", "uint8 early\nfloat64 peer_at")
    names = [name for name in DTYPE.names if name != "predicted"]
    now, old = noise(20, 1), np.zeros(20, dtype_of(text))
    for name in names:
        old[name] = now[name]
    old["early"] = np.arange(20)
    write_elsewhere(path, {"slave": old}, text=text)
    records = read_recording(path).records["slave"]
    assert set(records.dtype.names) == {"early", *names}
    assert records["early"].tolist() == list(range(20))
    for name in names:
        assert records[name].tobytes() == now[name].tobytes()


def test_nothing_and_a_folder(tmp_path):
    assert "No such file" in error_of(tmp_path / "none.mcap")
    assert "directory" in error_of(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty; expected a recording"),
        (b"t,px,py,pz,fx,fy,fz\n0,0,0,0,0,0,0\n", "is no MCAP file, it begins with b't,px,py,'"),
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "is no MCAP file"),
        (b"#ROSBAG V2.0\nE\0\0\0", "is no MCAP file, it begins with b'#ROSBAG '"),
        (b"\x89MCAP0", "is no MCAP file"),
        (b"\x89MCAP0\r\n", "is cut off before its first record"),
    ],
)
def test_a_file_of_something_else(path, content, message):
    path.write_bytes(content)
    assert message in error_of(path)


@pytest.mark.parametrize(
    ("text", "changes", "message"),
    [
        ("float64 at\n", {}, "/weberlink/slave: its schema weberlink_msgs/msg/Tick lacks tick"),
        ("float32 at\nuint8 tick\n", {}, "lacks at and tick"),
        ("float64 at\nuint64 tick\nstring note\n", {}, "field note is of type string"),
        ("", {}, "no field is defined"),
        (SCHEMA_TEXT, {"encoding": "protobuf"}, "'protobuf'"),
        (SCHEMA_TEXT, {"message": "json"}, "is encoded as 'json'"),
        (SCHEMA_TEXT, {"metadata": {}}, "rate_hz = None, expected a number"),
        (SCHEMA_TEXT, {"metadata": {"rate_hz": "1000.0", "wall_s": "noon"}}, "wall_s = 'noon', expected a number"),
        (SCHEMA_TEXT, {"head": b"\0\0\0\0"}, "not plain little-endian CDR"),
    ],
)
def test_a_topic_of_ours_with_something_else_in_it(path, text, changes, message):
    write_elsewhere(path, {"slave": noise(3, 1)}, text=text, changes=changes)
    assert message in error_of(path)
