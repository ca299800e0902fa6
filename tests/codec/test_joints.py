"""What a stream of joints has beside the contract of a channel: one decision for axes of different thresholds."""

import pytest

from tests.codec.law import AXIS_BOUNDS as BOUNDS
from weberlink.codec import Channel, Decoder, Encoder
from weberlink.codec.channel import joint_channel
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import PreviousSample, Update

STEP = 1e-3


def channel_of(axes: int, predictor: str = "linear") -> Channel:
    return joint_channel(predictor=predictor, bounds=BOUNDS[:axes], step=STEP)


@pytest.mark.parametrize(("axes", "groups"), [(1, (1,)), (3, (3,)), (4, (3, 1)), (7, (3, 3, 1))])
def test_the_wire_carries_only_axes_that_exist(axes: int, groups: tuple[int, ...]) -> None:
    channel = channel_of(axes)
    assert channel.forms[0].newest == channel.forms[0].previous == groups
    update = Encoder(channel).encode(0, (0.1,) * axes)
    assert update == Update(0, 0, (100,) * axes)
    shortest, longest = UpdateLayout(channel.forms).lengths
    assert shortest <= UpdateLayout(channel.forms).length(update) <= longest
    decoder = Decoder(channel)
    assert (decoder.joints(5), decoder.newest) == (None, None)
    for wrong in (Update(0, 0, (0,) * (axes + 1)), Update(0, 0, (0,) * axes, PreviousSample(1, (0,) * (axes + 1)))):
        with pytest.raises(ValueError, match="levels"):
            decoder.apply(wrong)


def test_rest_is_displayed_and_not_sent() -> None:
    rest = (0.5, 0.0, 0.0, -0.25)
    channel = joint_channel(bounds=(0.1, 0.1, 0.1, 0.1), step=STEP, rest=rest)
    encoder, decoder = Encoder(channel), Decoder(channel)
    assert encoder.coded == rest
    assert encoder.encode(0, (0.55, 0.0, -0.05, -0.16)) is None
    assert decoder.joints(0) == encoder.held == rest
    assert encoder.encode(1, (0.5, 0.0, 0.0, 0.0)) is not None


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="rest has 2 axes"):
        joint_channel(bounds=(0.1,) * 4, step=STEP, rest=(0.0, 0.0))
    for predictor in ("plane", "path", "hybrid", "nothing"):
        with pytest.raises(ValueError, match=predictor):
            channel_of(4, predictor)
    encoder = Encoder(channel_of(4))
    with pytest.raises(ValueError, match="3 axes, expected 4"):
        encoder.encode(0, (0.0, 0.0, 0.0))
