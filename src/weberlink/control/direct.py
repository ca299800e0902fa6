"""No control: the decoded force is displayed and the decoded position followed.

For links with a delay that is not felt. `weberlink stability` measures at which stiffness and delay the loop is stable.
"""

from weberlink.control.contract import LinkQuality, SchemeParameters, WallModel
from weberlink.control.matching import ForceMatching
from weberlink.geometry.vector import Vector


class _Uncontrolled:
    __slots__ = ()

    active = "none"
    tank = 0.0
    credit = 0

    def __init__(self, settings: SchemeParameters) -> None: ...

    def reset(self) -> None: ...

    def resume(self, peer_credit: int) -> None: ...


class DirectMaster(_Uncontrolled):
    """Displays the decoded force."""

    __slots__ = ("_matching",)

    def __init__(self, settings: SchemeParameters) -> None:
        super().__init__(settings)
        self._matching = ForceMatching(settings.coupling)

    @property
    def stiffness(self) -> float:
        return self._matching.stiffness

    def reset(self) -> None:
        self._matching.reset()

    def resume(self, peer_credit: int) -> None:  # noqa: ARG002
        self._matching.reset()

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:  # noqa: ARG002
        self._matching.learn(surface)

    def observe(
        self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality
    ) -> None: ...

    def command(self, position: Vector) -> Vector:
        return position

    def render(self, force: Vector) -> Vector:
        return force

    def displayed(self, force: Vector) -> None: ...


class DirectSlave(_Uncontrolled):
    """Follows the decoded position."""

    __slots__ = ()

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:  # noqa: ARG002
        return target

    def observe(self, position: Vector, force: Vector) -> None: ...
