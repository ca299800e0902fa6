"""Look-ahead: the encoder decides on a sample when it knows the samples of the next L ticks.

The other end displays the signal L ticks late. An update carries the tick of the sample that it codes, and the decoder
evaluates its model at the present tick less L. The causal encoder is the case L = 0.
"""

from collections import deque
from typing import NamedTuple

from weberlink.geometry.vector import Vector


class Taken(NamedTuple):
    """A measured sample that waits for its decision.

    Args:
        tick: the sender's tick number.
        value: as measured.
        actual: the same within the range of the wire.
        position: commanded position at which a force was measured [m].
        most: largest error that may stay unsent.
        bound: the deadband if the sample were displayed and sent as measured; 0 without look-ahead, where nobody reads
            it.
    """

    tick: int
    value: Vector
    actual: Vector
    position: Vector
    most: float
    bound: float = 0.0


class Window:
    """The samples that are known and not yet decided on.

    A tick without a sample gets no decision, and neither does a sample whose time passed while nothing was encoded.

    Args:
        length: L [ticks], >= 0.
    """

    def __init__(self, length: int) -> None:
        self.length = length
        self._samples: deque[Taken] = deque()

    def clear(self) -> None:
        self._samples.clear()

    def take(self, sample: Taken) -> None:
        """Add the sample of a tick. One that does not rise (the sender's ticks began anew) clears the window."""
        samples = self._samples
        if samples and sample.tick <= samples[-1].tick:
            samples.clear()
        samples.append(sample)

    def due(self, tick: int) -> Taken | None:
        """Remove and return the sample of `length` ticks before this one; None if there was none."""
        samples, due = self._samples, tick - self.length
        while samples and samples[0].tick < due:
            samples.popleft()
        return samples.popleft() if samples and samples[0].tick == due else None

    def following(self, tick: int) -> list[Taken]:
        """The samples that follow a tick without a gap."""
        run: list[Taken] = []
        for sample in self._samples:
            tick += 1
            if sample.tick != tick:
                break
            run.append(sample)
        return run
