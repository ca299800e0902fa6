"""The time that a test picture shows is read back after JPEG and scaling, and nothing else passes for one."""

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given, strategies as st
from PIL import Image

from weberlink_video.pattern import Pattern, jpeg_of, time_in


@pytest.mark.parametrize("size", [(640, 480), (320, 240), (1280, 720)])
@given(st.floats(0.0, 250_000.0))
def test_time_is_read_back(size: tuple[int, int], at: float) -> None:
    shown = Image.open(BytesIO(jpeg_of(Pattern(size).draw(at), 60))).convert("L")
    for scaled in (shown, shown.resize((517, 399))):
        assert time_in(np.asarray(scaled)) == pytest.approx(at, abs=6e-4)


def test_other_pictures_show_no_time() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (200, 120, 160), np.uint8)
    assert sum(time_in(picture) is not None for picture in noise) < 30, "a check of four bits passes 1 of 16"
