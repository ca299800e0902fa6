"""What is no JPEG, or too large to show, is refused before anybody decodes it; a stream is cut where pictures end."""

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given, strategies as st
from PIL import Image

from weberlink_figures.pictures import LARGEST
from weberlink_video.jpeg import Splitter, check


def jpeg(width: int = 64, height: int = 48, **options: object) -> bytes:
    out = BytesIO()
    noise = np.random.default_rng(width).integers(0, 255, (height, width, 3), np.uint8)
    Image.fromarray(noise).save(out, "JPEG", **options)
    return out.getvalue()


PICTURES = [jpeg(64, 48), jpeg(96, 64), jpeg(80, 72, progressive=True), jpeg(72, 80, exif=b"Exif\0\0\xff\xd9")]


def claims(width: int, height: int) -> bytes:
    made = bytearray(jpeg())
    at = made.index(b"\xff\xc0") + 5
    made[at : at + 4] = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    return bytes(made)


@pytest.mark.parametrize("picture", PICTURES)
def test_size_is_that_of_the_decoded_picture(picture: bytes) -> None:
    assert check(picture) == Image.open(BytesIO(picture)).size


@given(st.integers(0, 1000), st.lists(st.integers(50, 5000), min_size=1, max_size=20))
def test_stream_is_cut_into_its_pictures_however_it_is_read(start: int, sizes: list[int]) -> None:
    stream, splitter, found = b"".join(PICTURES), Splitter(), []
    at = 0
    while at < len(stream):
        size = sizes[start % len(sizes)]
        found += splitter.add(stream[at : at + size])
        at, start = at + size, start + 1
    assert found == PICTURES


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"rubbish", b"\xff\xd8", PICTURES[0][:-2], PICTURES[0][:40], b"\xff\xd8" + bytes(100)),
        *(claims(0, 48), claims(65_535, 65_535), claims(64, 4097), PICTURES[0] + bytes(LARGEST)),
    ],
)
def test_rubbish_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        check(data)


@given(st.binary(max_size=300), st.integers(0, 700))
def test_damage_is_refused_or_changes_no_more_than_what_is_shown(noise: bytes, at: int) -> None:
    damaged = PICTURES[0][:at] + noise + PICTURES[0][at + len(noise) :]
    try:
        size = check(damaged)
    except ValueError:
        return
    assert max(size) <= 4096


def test_stream_without_an_end_takes_no_more_memory_than_a_picture() -> None:
    splitter = Splitter()
    splitter.add(PICTURES[0][:-2])
    with pytest.raises(ValueError, match="more than"):
        for _ in range(2 * LARGEST // 65_536 + 1):
            splitter.add(bytes(65_536))
