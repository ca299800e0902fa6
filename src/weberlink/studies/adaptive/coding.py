"""One signal through a sender, and what the other end then displays. No run time: that is in `cost`."""

from typing import NamedTuple

import numpy as np

from weberlink.codec import Encoder
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.studies.evaluate.replay import Array, Signal
from weberlink.system.scoring.perception import Threshold, in_units, rms

HIGH = 99.9
"""Percentile of the steps."""


class Feel(NamedTuple):
    """What a person has of it."""

    error_rms_n: float
    error_rms_jnd: float
    largest_step_n: float
    """Of the displayed force, from tick to tick."""
    step_jnd: float
    """99.9th percentile of these, each in units of the threshold at its tick."""


class Coded(NamedTuple):
    """What came of a signal.

    Args:
        packets: updates sent.
        displayed_n: shape (n, 3) [N].
        outside: ticks whose error was beyond the deadband.
        error_n: shape (n,) [N].
    """

    packets: int
    displayed_n: Array
    outside: int
    error_n: Array

    def feel(self, signal: Signal, threshold: Threshold) -> Feel:
        """What of it a person with this threshold feels."""
        least = threshold.of(signal.force_n)
        steps = np.linalg.norm(np.diff(self.displayed_n, axis=0), axis=1)
        in_jnd = in_units(steps, least[1:])
        return Feel(
            rms(self.error_n),
            rms(in_units(self.error_n, least)),
            float(steps.max(initial=0.0)),
            float(np.percentile(in_jnd, HIGH)) if len(in_jnd) else 0.0,
        )


def coded(signal: Signal, encoder: Encoder) -> Coded:
    """On a link that loses nothing and takes no time, where the receiver is the sender's mirror of it.

    Args:
        signal: at least one sample.
        encoder: fresh; its deadband is one that measures distances.
    """
    encode, value = encoder.encode, encoder.mirror.value
    displayed: list[Vector] = []
    errors: list[float] = []
    packets = outside = 0
    for tick, (force, position) in enumerate(signal.samples):
        if encode(tick, force, position) is not None:
            packets += 1
            held = value(tick, position) or ZERO
        else:
            held = encoder.predicted or ZERO
        error = distance(held, force)
        outside += error > encoder.bound
        displayed.append(held)
        errors.append(error)
    return Coded(packets, np.array(displayed), outside, np.array(errors))
