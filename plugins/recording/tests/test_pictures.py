"""Pictures in a recording: read by others' readers, on the clock of the records, and as the video of a dataset."""

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import mcap_ros2.decoder
import numpy as np
import pytest
from hypothesis import given, strategies as st
from mcap.reader import make_reader
from PIL import Image

from plugins.recording.tests import arm_sessions
from plugins.recording.tests.records import FACTS, MONOTONIC_S, WALL_S, origin
from plugins.recording.tests.test_exports import session
from tests.records import ticks
from weberlink_figures.message import ENCAPSULATION
from weberlink_recording.lerobot_export import write_dataset
from weberlink_recording.lerobot_frames import frames_of
from weberlink_recording.pictures import RecordedPicture, pack_picture, read_picture
from weberlink_recording.reader import read_recording
from weberlink_recording.session import SessionPicture, put_together
from weberlink_recording.writer import RecordingWriter

names = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), min_size=1, max_size=20)


@pytest.fixture(scope="module")
def sides():
    """Of two arms, for 3 s."""
    return {side: arm_sessions.records(side, 3000) for side in ("master", "slave")}


def jpeg(level: int) -> bytes:
    out = BytesIO()
    Image.fromarray(np.full((48, 64, 3), level, np.uint8)).save(out, "JPEG")
    return out.getvalue()


@given(st.integers(0, 2**31 * 10**9 - 1), names, st.binary(max_size=50))
def test_picture_is_read_as_it_was_packed(wall_ns: int, camera: str, data: bytes) -> None:
    packed = ENCAPSULATION + pack_picture(RecordedPicture(wall_ns, camera, data))
    assert read_picture(packed) == (wall_ns, camera, data)
    for cut in range(len(packed) - 12):
        with pytest.raises(ValueError, match="cut short"):
            read_picture(packed[:cut])


def test_other_decoders_read_pictures_and_ours_puts_them_on_the_clock_of_the_records(tmp_path: Path) -> None:
    path = tmp_path / "pictures.mcap"
    made = [RecordedPicture(round((WALL_S + 0.5 * number) * 1e9), "wrist cam", jpeg(number)) for number in range(3)]
    with RecordingWriter.create(path, {"bank": FACTS["bank"]}) as writer:
        writer.add_side(origin("master"))
        for number, picture in enumerate(made):
            writer.write("master", ticks(5, start=MONOTONIC_S + 0.005 * number, tick=5 * number + np.arange(5)))
            writer.picture(picture)
            writer.flush()
    assert not read_recording(path).pictures, "not in memory unless asked for"
    recording = read_recording(path, with_pictures=True)
    assert recording.complete
    assert recording.pictures == tuple(made)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[mcap_ros2.decoder.DecoderFactory()])
        found = list(reader.iter_decoded_messages(topics=["/weberlink/pictures/wrist_cam"]))
    assert {one.schema.name for one in found} == {"foxglove_msgs/msg/CompressedImage"}
    assert [bytes(one.decoded_message.data) for one in found] == [picture.jpeg for picture in made]
    assert found[0].decoded_message.format == "jpeg"
    assert found[0].decoded_message.frame_id == "wrist cam"
    at = [picture.at for picture in put_together([recording]).pictures]
    assert at == pytest.approx([MONOTONIC_S, MONOTONIC_S + 0.5, MONOTONIC_S + 1.0], abs=1e-6)


def test_frame_has_the_newest_picture_and_its_age_and_none_is_made_of_an_unseen_time(sides) -> None:
    whole = frames_of(session(sides), 30)
    first = float(sides["master"]["at"][0])
    at = [first + 0.5 + number / 20.0 for number in range(30) if not 10 <= number < 25]
    seen = replace(session(sides), pictures=tuple(SessionPicture(when, "w", str(when).encode()) for when in at))
    frames = frames_of(seen, 30)
    assert len(frames.times) < len(whole.times)
    (video,) = frames.videos
    ages = next(each.values[:, 0] for each in frames.features if each.key == "session.age.w")
    for frame, shown, age in zip(frames.times + first, video.jpegs, ages, strict=True):
        newest = max(when for when in at if when <= frame)
        assert shown == str(newest).encode()
        assert age == pytest.approx(frame - newest, abs=1e-6)
    assert max(ages) < 1.0 + 1.0 / arm_sessions.RATE


def test_video_has_the_very_pictures(sides, tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="needs PyAV: pip install -e 'plugins/recording[video]'")
    at = float(sides["master"]["at"][0]) + np.arange(60) / 20.0
    seen = tuple(SessionPicture(float(when), "w", jpeg(4 * number)) for number, when in enumerate(at))
    frames = frames_of(replace(session(sides), pictures=seen), 30)
    write_dataset(frames, "task", None, tmp_path / "set")
    with av.open(str(tmp_path / "set/videos/observation.images.w/chunk-000/file-000.mp4")) as video:
        packets = [bytes(packet) for packet in video.demux(video=0) if packet.size]
    assert packets == list(frames.videos[0].jpegs)
