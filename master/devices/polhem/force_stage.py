"""From a force on the hand to whole milliamperes within all limits; pure."""

from collections.abc import Sequence

from weberlink.geometry.vector import Vector, add, norm, scale
from weberlink.master.devices.polhem.mechanism import Mechanism

RAMP_S = 0.05
"""In which the force comes up after a connection or a stall [s]."""


class ForceStage:
    """Cuts the force, turns it into currents, and cuts these.

    Args:
        mechanism: of the device.
        force_n: largest force [N]; 0 for never a current.
        current_ma: largest current per motor [mA]. Where one motor would need more, all get less, so that the force
            keeps its direction.
        carry: whether the motors carry the weight of the links too. The limits hold for the sum.
    """

    def __init__(self, mechanism: Mechanism, force_n: float, current_ma: float, *, carry: bool = False) -> None:
        self._mechanism = mechanism
        self._force_n = force_n
        self._current_ma = current_ma
        self._carry = carry

    def currents_ma(self, force: Vector, counts: Sequence[int], elapsed: float) -> tuple[int, int, int]:
        """Currents for a force [N] in the pose of `counts`, `elapsed` [s] after the connection or a stall."""
        limit = self._force_n * min(1.0, max(0.0, elapsed / RAMP_S))
        if self._carry:
            force = add(force, self._mechanism.carrying_force(counts))
        length = norm(force)
        if length == 0.0 or limit == 0.0:
            return (0, 0, 0)
        if length > limit:
            force = scale(force, limit / length)
        currents = self._mechanism.currents_ma(force, counts)
        largest = max(map(abs, currents))
        if largest > self._current_ma:
            currents = scale(currents, self._current_ma / largest)
        a, b, c = map(int, currents)  # towards zero, hence never beyond a limit
        return (a, b, c)
