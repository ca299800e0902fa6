"""Frames: bytes that others make for the same request, and what a reader makes of any bytes."""

from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.feetech import packet
from weberlink.arms.feetech.packet import Frame, FrameReader, encode

any_frame = st.builds(Frame, st.integers(0, 253), st.integers(0, 255), st.binary(max_size=40))


@given(st.lists(any_frame, max_size=5), st.lists(st.integers(0, 200), max_size=6))
def test_frames_survive_any_cutting(frames: list[Frame], cuts: list[int]) -> None:
    stream = b"".join(map(encode, frames))
    reader, begin, seen = FrameReader(), 0, []
    for end in [*sorted(cuts), len(stream)]:
        seen += reader.feed(stream[begin:end])
        begin = max(begin, end)
    assert seen == frames
    assert reader.bad_checksums == 0


@given(st.binary(max_size=200))
def test_no_bytes_break_a_reader(noise: bytes) -> None:
    reader = FrameReader()
    reader.feed(noise)
    seen = reader.feed(bytes(260) + encode(Frame(3, 0, b"ok")))
    assert seen[-1] == Frame(3, 0, b"ok")


@given(any_frame, st.integers(1, 255), st.data())
def test_a_changed_byte_is_noticed(frame: Frame, change: int, data: st.DataObject) -> None:
    whole = bytearray(encode(frame))
    at = data.draw(st.integers(4, len(whole) - 1))
    whole[at] ^= change
    assert frame not in FrameReader().feed(bytes(whole))


def test_requests_are_those_of_lerobot() -> None:
    """Captured from FeetechMotorsBus of lerobot 0.4.4: a sync read of positions, a sync write of goals."""
    ids = range(1, 7)
    assert packet.sync_read(56, 2, ids).hex() == "fffffe0a82380201020304050626"
    goals = [(id_, (2218 + 17 * (id_ == 6)).to_bytes(2, "little")) for id_ in ids]
    written = "fffffe16832a0201aa0802aa0803aa0804aa0805aa0806bb08ea"
    assert packet.sync_write(42, 2, goals).hex() == written
