"""Samples per second of the codec."""

from benchmarks.codec_rate import code, measure
from weberlink.codec import force_channel


def test_every_sample_is_coded_and_timed() -> None:
    times = code(force_channel(), [((0.0, 0.0, 0.1 * tick), (0.0, 0.0, -1e-4 * tick)) for tick in range(50)])
    assert len(times) == 50
    assert all(times > 0.0)


def test_the_rate_is_that_of_the_whole_recording() -> None:
    document = measure(quick=True).as_json()
    assert document["live_samples_per_s"] > 0.0
    assert document["samples"] > 1000
