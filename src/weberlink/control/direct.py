"""No control: what was decoded is displayed and followed. For links whose delay is not felt.

Assumes that the loop is stable by itself; adds no lag. Which stiffness and delay that holds for is what
`weberlink stability` measures.
"""

from weberlink.control.contract import LinkQuality, SchemeParameters, WallModel
from weberlink.geometry.vector import Vector


class DirectMaster:
    """Displays what the decoder says."""

    __slots__ = ()

    active = "none"
    tank = 0.0
    credit = 0

    def __init__(self, settings: SchemeParameters) -> None:
        """Make it; nothing of the settings is needed."""

    def reset(self) -> None: ...

    def resume(self, peer_credit: int) -> None: ...

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None: ...

    def observe(self, position: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> None: ...

    def render(self, force: Vector) -> Vector:
        return force

    def displayed(self, force: Vector) -> None: ...


class DirectSlave:
    """Follows the decoder."""

    __slots__ = ()

    active = "none"
    tank = 0.0
    credit = 0

    def __init__(self, settings: SchemeParameters) -> None:
        """Make it; nothing of the settings is needed."""

    def reset(self) -> None: ...

    def resume(self, peer_credit: int) -> None: ...

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:  # noqa: ARG002
        return target

    def observe(self, position: Vector, force: Vector) -> None: ...
