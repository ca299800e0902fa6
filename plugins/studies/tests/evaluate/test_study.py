"""Rows of a study: beside a plain run of the codec, an independent implementation, and in any order of tasks."""

from math import hypot, log, sqrt

import numpy as np
import pytest

from plugins.studies.tests.evaluate.signals import walk, wall
from weberlink.codec import Channel, Decoder, Encoder, force_channel
from weberlink.geometry.vector import Vector
from weberlink.master.trace import Trace
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import UpdateLayout
from weberlink_figures.felt import Threshold
from weberlink_studies.evaluate.replay import signal_of
from weberlink_studies.evaluate.study import evaluate

PREDICTORS = ("zoh", "plane", "hybrid")


def plain_run(signal: Trace, channel: Channel) -> tuple[list[Vector], list[float], list[int], list[bool]]:
    """Decoded forces, bounds, the size of the datagram of every update, and whether a tick had one."""
    encoder, decoder, layout = Encoder(channel), Decoder(channel), UpdateLayout(channel.forms)
    decoded, bounds, datagrams, sends = [], [], [], []
    for tick, (force, position) in enumerate(zip(signal.force_n.tolist(), signal.position_m.tolist(), strict=True)):
        update = encoder.encode(tick, tuple(force), tuple(position))
        sends.append(update is not None)
        if update is not None:
            decoder.apply(update)
            packed = layout.pack((1, 0, 2, 3, (4,)), 0, update)
            datagrams.append(len(packed) + PresharedKey.tag_size)
        held = decoder.value(tick, tuple(position))
        assert held is not None
        decoded.append(held)
        bounds.append(encoder.bound)
    return decoded, bounds, datagrams, sends


@pytest.mark.parametrize("predictor", PREDICTORS)
@pytest.mark.parametrize("signal", [wall(), walk(600, seed=4)], ids=["wall", "walk"])
def test_figures_are_those_of_a_plain_run(signal: Trace, predictor: str) -> None:
    channel = force_channel(predictor=predictor, weber=0.20)
    found = evaluate("made", signal_of(signal), channel, Threshold(0.10), predictor="zoh", weber=0.10)
    decoded, bounds, datagrams, sends = plain_run(signal, channel)
    errors = [hypot(*np.subtract(a, b)) for a, b in zip(decoded, signal.force_n.tolist(), strict=True)]
    jnds = [max(0.10 * hypot(*force), 0.04) for force in signal.force_n.tolist()]
    in_jnd = [error / jnd for error, jnd in zip(errors, jnds, strict=True)]
    duration = len(errors) * 1e-3
    assert len(datagrams) > 1
    assert found["packets"] == len(datagrams)
    assert found["bytes_per_s"] == pytest.approx(sum(datagrams) / duration)
    assert found["packets_per_s"] == pytest.approx(found["packets"] / duration)
    assert found["reduction"] == pytest.approx(1.0 - found["packets"] / len(errors))
    assert found["error_rms_n"] == pytest.approx(sqrt(sum(e * e for e in errors) / len(errors)))
    assert found["error_max_n"] == pytest.approx(max(errors))
    assert found["error_max_deadbands"] == pytest.approx(max(e / b for e, b in zip(errors, bounds, strict=True)))
    assert found["error_rms_jnd"] == pytest.approx(sqrt(sum(x * x for x in in_jnd) / len(in_jnd)))
    assert found["error_max_jnd"] == pytest.approx(max(in_jnd))
    assert found["noticeable_fraction"] == pytest.approx(sum(x > 1.0 for x in in_jnd) / len(in_jnd))
    logs = [
        abs(log((hypot(*f) + 0.4) / (hypot(*d) + 0.4))) / log(1.1)
        for f, d in zip(signal.force_n.tolist(), decoded, strict=True)
    ]
    assert found["log_error_rms_jnd"] == pytest.approx(sqrt(sum(x * x for x in logs) / len(logs)))
    assert found["log_error_max_jnd"] == pytest.approx(max(logs))
    jumps = [
        hypot(*np.subtract(new, old)) / max(0.10 * hypot(*old), 0.04)
        for sent, new, old in zip(sends[1:], decoded[1:], decoded, strict=False)
        if sent
    ]
    assert found["jump_median_jnd"] == pytest.approx(sorted(jumps)[(len(jumps) - 1) // 2], rel=0.005)
    assert found["jump_max_jnd"] == pytest.approx(max(jumps))
    assert (found["violation_fraction"], found["violation_longest_s"]) == (0.0, 0.0)
    assert found["error_max_deadbands"] <= 1.0
    assert found["tick_us"] > 0.0
    if predictor == "hybrid":
        assert list(found["selected"]) == ["zoh", "linear", "plane", "sphere"]
        assert sum(found["selected"].values()) == found["packets"]
    else:
        assert "selected" not in found
