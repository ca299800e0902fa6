"""Samples per second of the codec, with the compiled engine and where there is none."""

from importlib.util import find_spec

import pytest

from benchmarks.codec_rate import code, find_engine, measure
from weberlink.codec import force_channel


def test_every_sample_is_coded_and_timed() -> None:
    times = code(force_channel(), [((0.0, 0.0, 0.1 * tick), (0.0, 0.0, -1e-4 * tick)) for tick in range(50)])
    assert len(times) == 50
    assert all(times > 0.0)


def test_without_the_engine_the_report_says_what_to_install() -> None:
    rate = measure(quick=True, find=lambda: None)
    document = rate.as_json()
    assert document["compiled_samples_per_s"] is document["compiled_over_live"] is None
    assert 'pip install "weberlink[compiled]"' in document["compiled_note"]
    assert document["live_samples_per_s"] > 0.0
    assert document["samples"] > 1000


def test_an_engine_is_put_beside_the_live_codec() -> None:
    document = measure(quick=True, find=lambda: lambda channel, trace: 1e6 * len(channel.bank)).as_json()
    assert document["compiled_samples_per_s"] == 4e6
    assert document["compiled_note"] is None
    assert document["compiled_over_live"] == pytest.approx(4e6 / document["live_samples_per_s"])


def test_the_engine_is_there_where_numba_is() -> None:
    assert (find_engine() is None) is (find_spec("numba") is None)
