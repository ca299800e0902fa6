"""Indexing: while a button is pressed the hand moves and the robot stays, as one lifts a mouse."""

from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product
from weberlink.geometry.vector import ZERO, Vector, add, subtract


class Clutch:
    """Keeps what the hand and the robot are apart by.

    Args:
        button: which one disengages, from 0.
    """

    __slots__ = ("_button", "_held", "_held_turn", "_index", "_turn")

    def __init__(self, button: int) -> None:
        self._button = button
        self._index: Vector = ZERO
        self._held: Vector | None = None
        self._turn: Quaternion = IDENTITY
        self._held_turn: Quaternion | None = None

    def reset(self) -> None:
        """Engaged, with nothing between hand and robot."""
        self._index, self._held = ZERO, None
        self._turn, self._held_turn = IDENTITY, None

    @property
    def engaged(self) -> bool:
        """Whether the robot follows the hand."""
        return self._held is None

    def pass_through(self, position: Vector, buttons: int, keep: Vector | None) -> Vector:
        """Where the robot is to be.

        Args:
            position: of the hand, mapped, without any indexing [m].
            buttons: that are pressed, a bit each.
            keep: where the robot was last; what it stays at while disengaged. None before the first reading, which
                engages whatever is pressed.
        """
        if buttons >> self._button & 1 and keep is not None:
            if self._held is None:
                self._held = keep
            return self._held
        if self._held is not None:
            self._index = subtract(self._held, position)
            self._held = None
        return add(position, self._index)

    def pass_orientation(self, orientation: Quaternion, keep: Quaternion | None) -> Quaternion:
        """The orientation that the tool is to have; asked after `pass_through`, which knows the button.

        Args:
            orientation: of the handle, mapped, without any indexing.
            keep: that of the tool at the last reading; None before the first.
        """
        if self._held is not None:
            if self._held_turn is None:
                self._held_turn = orientation if keep is None else keep
            return self._held_turn
        if self._held_turn is not None:
            # On the right, so that a turn of the hand about an axis stays one of the tool about the same axis.
            self._turn = product(inverse(orientation), self._held_turn)
            self._held_turn = None
        return orientation if self._turn == IDENTITY else product(orientation, self._turn)
