"""The figures of a row, beside the same from a plain run of the codec."""

import json
from dataclasses import replace
from math import hypot, sqrt

import numpy as np
import pytest

from tests.studies.evaluate.signals import trace, walk, wall
from weberlink.codec import Channel, Decoder, Encoder, force_channel
from weberlink.geometry.vector import Vector
from weberlink.master.trace import Trace
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import UpdateLayout
from weberlink.studies.evaluate.replay import replay, signal_of
from weberlink.studies.evaluate.study import Recording, Row, Study, code
from weberlink.system.scoring.perception import Threshold

PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid")
STEP = trace([0.0] * 10 + [2.0] * 10, [0.0] * 20)


def row_of(signal: Trace, channel: Channel, jnd: float = 0.10) -> Row:
    return code("made", signal_of(signal), "zoh", 0.10, channel, Threshold(jnd, 0.02).of(signal.force_n))


def plain_run(signal: Trace, channel: Channel) -> tuple[list[Vector], list[float], list[int]]:
    """Decoded forces, bounds, and the datagram of every update in bytes, packed for the wire."""
    encoder, decoder, layout = Encoder(channel), Decoder(channel), UpdateLayout(channel.level_count)
    decoded, bounds, datagrams = [], [], []
    for tick, (force, position) in enumerate(zip(signal.force_n.tolist(), signal.position_m.tolist(), strict=True)):
        update = encoder.encode(tick, tuple(force), tuple(position))
        if update is not None:
            decoder.apply(update)
            packed = layout.pack(1, 0, update.selector, update.newest, update.gap, update.previous)
            datagrams.append(len(packed) + PresharedKey.tag_size)
        held = decoder.value(tick, tuple(position))
        assert held is not None
        decoded.append(held)
        bounds.append(encoder.bound)
    return decoded, bounds, datagrams


@pytest.mark.parametrize("predictor", PREDICTORS)
@pytest.mark.parametrize("signal", [wall(), walk(600, seed=4)], ids=["wall", "walk"])
def test_figures_are_those_of_a_plain_run(signal: Trace, predictor: str) -> None:
    channel = force_channel(predictor=predictor, weber=0.20)
    found = row_of(signal, channel)
    decoded, bounds, datagrams = plain_run(signal, channel)
    errors = [hypot(*np.subtract(a, b)) for a, b in zip(decoded, signal.force_n.tolist(), strict=True)]
    jnds = [max(0.10 * hypot(*force), 0.02) for force in signal.force_n.tolist()]
    in_jnd = [error / jnd for error, jnd in zip(errors, jnds, strict=True)]
    duration = len(errors) * 1e-3
    assert len(datagrams) > 1
    assert found.packets == len(datagrams)
    assert found.bytes_per_s == pytest.approx(sum(datagrams) / duration)
    assert found.packets_per_s == pytest.approx(found.packets / duration)
    assert found.reduction == pytest.approx(1.0 - found.packets / len(errors))
    assert found.error_rms_n == pytest.approx(sqrt(sum(e * e for e in errors) / len(errors)))
    assert found.error_max_n == pytest.approx(max(errors))
    assert found.jnd_max == pytest.approx(max(e / b for e, b in zip(errors, bounds, strict=True)))
    assert found.error_rms_jnd == pytest.approx(sqrt(sum(x * x for x in in_jnd) / len(in_jnd)))
    assert found.error_max_jnd == pytest.approx(max(in_jnd))
    assert found.noticeable_fraction == pytest.approx(sum(x > 1.0 for x in in_jnd) / len(in_jnd))
    assert (found.noticeable_fraction > 0.0) == any(x > 1.0 for x in in_jnd)
    assert (found.violation_fraction, found.violation_longest_s) == (0.0, 0.0)
    assert found.jnd_max <= 1.0
    assert found.tick_us > 0.0


def test_a_step_that_the_wire_cannot_say_is_outside_the_deadband() -> None:
    """Beyond the int16 range the decoder holds the end of the range."""
    found = row_of(trace([0.0] * 6 + [50.0] * 3 + [0.0] * 3, [0.0] * 12), force_channel(predictor="zoh", weber=0.10))
    assert found.error_max_n == pytest.approx(50.0 - 32.767)
    assert found.violation_fraction == pytest.approx(3 / 12)
    assert found.violation_longest_s == pytest.approx(3e-3)


def test_a_step_is_one_packet_and_no_error() -> None:
    found = row_of(STEP, force_channel(predictor="zoh", weber=0.10))
    assert (found.samples, found.packets) == (20, 1)
    assert found.bytes_per_s == pytest.approx(32 / 0.020)
    assert found.error_max_n == found.error_max_jnd == 0.0
    assert found.selected is None


def test_updates_with_history_are_longer() -> None:
    channel = force_channel(predictor="linear", weber=0.10)
    run = replay(signal_of(wall()), channel)
    with_history = [update for update in run.updates if update.previous]
    assert 0 < len(with_history) < len(run.updates)
    assert run.payload_bytes(channel) == 46 * len(with_history) + 32 * (len(run.updates) - len(with_history))


def test_the_hybrid_says_what_it_chose() -> None:
    found = row_of(wall(), force_channel(predictor="hybrid", weber=0.10))
    assert found.selected is not None
    assert list(found.selected) == ["zoh", "linear", "plane", "sphere"]
    assert sum(found.selected.values()) == found.packets


def test_a_person_who_notices_more_finds_more() -> None:
    channel = force_channel(predictor="zoh", weber=0.20)
    keen, dull = row_of(wall(), channel, jnd=0.05), row_of(wall(), channel, jnd=0.40)
    assert keen.noticeable_fraction > dull.noticeable_fraction == 0.0
    assert keen.error_rms_n == dull.error_rms_n


def test_excess_is_over_what_a_clairvoyant_would_send_where_that_is_anything() -> None:
    (found,) = Study(("zoh",)).rows(Recording("made", STEP))
    assert replace(found, packets=6, packets_per_s=300.0, clairvoyant_packets=4).excess == 1.5
    assert replace(found, packets=6, packets_per_s=300.0, clairvoyant_packets=4).clairvoyant_packets_per_s == 200.0
    for unknown in (replace(found, clairvoyant_packets=None), replace(found, packets=0, clairvoyant_packets=0)):
        assert unknown.excess is None
        assert "excess" not in unknown.as_json()


def test_a_row_is_json() -> None:
    for found in Study().rows(Recording("made", wall(300))):
        document = json.loads(json.dumps(found.as_json(), allow_nan=False))
        assert ("selected" in document) == (found.predictor == "hybrid")
        assert document.get("excess") == found.excess
