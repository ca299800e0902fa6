"""A contact that also resists being pressed in quickly."""

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.scenes.contact import Touch


class DampedContact:
    """f = max(0, k depth + b d(depth)/dt) n: along the normal only, and never pulling.

    The rate in `force` is the change of depth since the last call, so a commanded position that arrives in steps gives
    steps of force; the depth before the touch counts as 0, which can only underestimate the speed of impact. A body
    that has a velocity takes k and b from `touch`.
    """

    __slots__ = ("_damping", "_depth", "_stiffness")

    def __init__(self, stiffness: float, damping: float) -> None:
        self._stiffness = stiffness
        self._damping = damping
        self._depth = 0.0

    @property
    def state(self) -> float:
        return self._depth

    def restore(self, state: object) -> None:
        assert isinstance(state, float)
        self._depth = state

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:  # noqa: ARG002
        self._depth = depth
        return Touch(index, depth, normal, self._stiffness, self._damping, ZERO, 0.0)

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:  # noqa: ARG002
        f = self._stiffness * depth
        if dt > 0.0:
            f = max(0.0, f + self._damping * (depth - self._depth) / dt)
        self._depth = depth
        return (f * normal[0], f * normal[1], f * normal[2])

    def release(self) -> None:
        self._depth = 0.0
