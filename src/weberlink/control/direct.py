"""No control: the decoded force is displayed and the decoded position followed.

For links with a delay that is not felt. `weberlink study stability` measures at which stiffness and
delay the loop is stable.
"""

from typing import ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.control.contract import LinkQuality, SchemeParameters, WallModel
from weberlink.geometry.vector import Vector


@mypyc_attr(allow_interpreted_subclasses=True)
class NoControl:
    """An end that controls nothing."""

    __slots__ = ()

    energy: ClassVar[float] = 0.0
    credit: ClassVar[int] = 0

    def __init__(self, settings: SchemeParameters | None = None) -> None: ...

    def reset(self) -> None: ...

    def resume(self, peer_credit: int) -> None: ...


@mypyc_attr(allow_interpreted_subclasses=True)
class DirectMaster(NoControl):
    """Displays the decoded force."""

    __slots__ = ("_coupling", "stiffness")

    def __init__(self, settings: SchemeParameters) -> None:
        self.stiffness = self._coupling = settings.coupling

    def reset(self) -> None:
        self.stiffness = self._coupling

    def resume(self, peer_credit: int) -> None:  # noqa: ARG002
        self.reset()

    def refute(self) -> None: ...

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:  # noqa: ARG002
        self.stiffness = self._coupling if surface is None else surface.stiffness

    def observe(
        self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality
    ) -> None: ...

    def command(self, position: Vector) -> Vector:
        return position

    def render(self, force: Vector) -> Vector:
        return force

    def displayed(self, force: Vector) -> None: ...


@mypyc_attr(allow_interpreted_subclasses=True)
class DirectSlave(NoControl):
    """Follows the decoded position."""

    __slots__ = ()

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:  # noqa: ARG002
        return target

    def observe(self, position: Vector, force: Vector) -> None: ...
