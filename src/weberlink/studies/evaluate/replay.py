"""One recorded signal through a fresh encoder and decoder, sample by sample as a daemon would.

Owns the loop and what it leaves behind. The run time of a tick is that of encode and decode and of nothing else;
what can be worked out afterwards is. The same without the live objects, and faster, is `studies.evaluate.compiled`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel, Decoder, Encoder, Update
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.master.trace import Trace
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import UpdateLayout

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Signal:
    """A trace as the codec takes it.

    Args:
        force_n: shape (n, 3) [N].
        position_m: shape (n, 3) [m].
        period_s: time between samples.
    """

    force_n: Array
    position_m: Array
    period_s: float

    def __len__(self) -> int:
        return len(self.force_n)

    @cached_property
    def samples(self) -> list[tuple[Vector, Vector]]:
        """Force and position of each tick as plain tuples, whose floats are faster than those of arrays."""
        return list(zip(_vectors(self.force_n), _vectors(self.position_m), strict=True))

    @property
    def duration_s(self) -> float:
        """Every sample stands for one period."""
        return len(self) * self.period_s

    def middle(self, count: int) -> "Signal":
        """So many samples at most, from the middle: a hand comes to the matter after a while."""
        first = max(0, (len(self) - count) // 2)
        part = slice(first, first + count)
        return Signal(self.force_n[part], self.position_m[part], self.period_s)


@dataclass(frozen=True)
class Replay:
    """What came of a signal.

    Args:
        error_n: distance of the decoded force from the measured one at each tick, shape (n,) [N].
        bound_n: the deadband at each tick, shape (n,) [N].
        deviation_n: the error in the deadband's own measure, which is what the bound is of, shape (n,) [N].
        updates: those that were sent.
        selected: the predictor that each of them chose, by its index in the bank, shape (packets,).
        paired: how many of them carry the sample before.
        tick_us: median run time of encode plus decode by the live codec.
    """

    error_n: Array
    bound_n: Array
    deviation_n: Array
    updates: Sequence[Update]
    selected: Integers
    paired: int
    tick_us: float

    def payload_bytes(self, channel: Channel) -> int:
        """UDP payload of all updates on a secured link without delay control: each with its history or without, and
        its tag.
        """
        layout, packets = UpdateLayout(channel.grid.size), len(self.updates)
        return (
            self.paired * layout.size(with_previous=True)
            + (packets - self.paired) * layout.size(with_previous=False)
            + packets * PresharedKey.tag_size
        )


def signal_of(trace: Trace) -> Signal:
    return Signal(trace.force_n, trace.position_m, trace.period_s)


def replay(signal: Signal, channel: Channel) -> Replay:
    """Run a signal through the codec of a force channel, on a link that loses nothing and takes no time."""
    encoder, decoder = Encoder(channel), Decoder(channel)
    encode, apply, value = encoder.encode, decoder.apply, decoder.value
    errors: list[float] = []
    bounds: list[float] = []
    measure = channel.deadband.error
    deviations: list[float] = errors if measure is distance else []
    updates: list[Update] = []
    times: list[float] = []
    for tick, ((fx, fy, fz), (px, py, pz)) in enumerate(signal.samples):
        # Made here, as a daemon has just made them: a vector from afar would cost the tick its way to the processor.
        force, position = (fx, fy, fz), (px, py, pz)
        began = perf_counter()
        update = encode(tick, force, position)
        if update is not None:
            apply(update)
        held = value(tick, position)
        times.append(perf_counter() - began)
        # As the encoder computes it, to the last bit: an error on the bound must not count as one beyond it. At once,
        # since vectors that are kept would make every tick take fresh memory, which no daemon does.
        errors.append(distance(held or ZERO, force))
        bounds.append(encoder.bound)
        if deviations is not errors:
            deviations.append(measure(held or ZERO, force))
        if update is not None:
            updates.append(update)
    return Replay(
        np.array(errors),
        np.array(bounds),
        np.array(deviations),
        updates,
        np.array([update.selector for update in updates], np.int64),
        sum(update.payload is not None for update in updates),
        1e6 * float(np.median(times)),
    )


def _vectors(array: Array) -> list[Vector]:
    return [(x, y, z) for x, y, z in array.tolist()]
