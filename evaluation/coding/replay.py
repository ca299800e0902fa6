"""One recorded signal through a fresh encoder and decoder, sample by sample as a daemon would.

Owns the loop and what it leaves behind. The run time of a tick is that of encode and decode and of nothing else;
what can be worked out afterwards is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import dist
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codec import Channel, Decoder, Encoder, Update
from codec.vector import ZERO, Vector
from master.trace import Trace
from protocol.psk import PresharedKey
from protocol.wire import UpdateLayout

Array = NDArray[np.float64]


class Signal(NamedTuple):
    """A trace as the codec takes it: lists of plain tuples, whose floats are faster than those of arrays."""

    forces: list[Vector]
    positions: list[Vector]
    period_s: float
    """Time between samples."""

    @property
    def duration_s(self) -> float:
        """Every sample stands for one period."""
        return len(self.forces) * self.period_s


@dataclass(frozen=True)
class Replay:
    """What came of a signal, per tick.

    Args:
        error_n: distance of the decoded force from the measured one, shape (n,) [N].
        bound_n: the deadband, shape (n,) [N].
        updates: those that were sent.
        tick_us: median run time of encode plus decode.
    """

    error_n: Array
    bound_n: Array
    updates: Sequence[Update]
    tick_us: float


def signal_of(trace: Trace) -> Signal:
    """Convert once what many replays take."""
    return Signal(_vectors(trace.force_n), _vectors(trace.position_m), trace.period_s)


def replay(signal: Signal, channel: Channel) -> Replay:
    """Run a signal through the codec of a force channel, on a link that loses nothing and takes no time."""
    encoder, decoder = Encoder(channel), Decoder(channel)
    encode, apply, value = encoder.encode, decoder.apply, decoder.value
    errors: list[float] = []
    bounds: list[float] = []
    updates: list[Update] = []
    times: list[float] = []
    for tick, ((fx, fy, fz), (px, py, pz)) in enumerate(zip(signal.forces, signal.positions, strict=True)):
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
        errors.append(dist(held or ZERO, force))
        bounds.append(encoder.bound)
        if update is not None:
            updates.append(update)
    return Replay(np.array(errors), np.array(bounds), updates, 1e6 * float(np.median(times)))


def payload_bytes(updates: Sequence[Update], channel: Channel) -> int:
    """UDP payload of updates on a secured link without delay control: each with its history or without, and its tag."""
    layout = UpdateLayout(channel.level_count)
    paired = sum(bool(update.previous) for update in updates)
    plain = len(updates) - paired
    return (
        paired * layout.size(with_previous=True)
        + plain * layout.size(with_previous=False)
        + len(updates) * PresharedKey.tag_size
    )


def _vectors(array: Array) -> list[Vector]:
    return [(x, y, z) for x, y, z in array.tolist()]
