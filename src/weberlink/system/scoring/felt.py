"""How wrong the felt force of a simulated session was, in thresholds of a person.

Owns one number of a whole system in virtual time, where both sides tick together: the records of one tick belong
together. A live session is joined by `weberlink.system.scoring.session` instead.
"""

import numpy as np

from weberlink.protocol.states import State
from weberlink.system.scoring.perception import Threshold
from weberlink.system.scoring.session import Records


class FeltError:
    """Root mean square of the felt error, in JNDs of the force that the robot measured.

    Felt is what the operator's device was told, in the very tick. Ticks count while both sides are engaged and neither
    fades.

    Args:
        threshold: the JND; with a floor, since ticks without contact count too.
    """

    def __init__(self, threshold: Threshold) -> None:
        self._threshold = threshold
        self._square_sum = 0.0
        self._count = 0

    def add(self, master: Records, slave: Records) -> None:
        """Take the records of the same ticks of both sides."""
        counts = np.ones(len(slave), dtype=bool)
        for side in (master, slave):
            counts &= (side["state"] == State.ENGAGED.value) & (side["ramping"] == 0)
        force = slave["raw"][counts]
        error = np.linalg.norm(master["output"][counts] - force, axis=1)
        self._square_sum += float(np.square(error / self._threshold.of(force)).sum())
        self._count += int(counts.sum())

    @property
    def rms_jnd(self) -> float | None:
        """None if nothing was felt."""
        return (self._square_sum / self._count) ** 0.5 if self._count else None
