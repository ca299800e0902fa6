"""The two ends of a control scheme, what they are given, and what they do under `none`: the decoded force is displayed,
and the decoded position followed.

Every scheme inherits from these. Without control is for links with a delay that is not felt; `weberlink study
stability` measures at which stiffness and delay the loop is stable.
"""

from collections import deque
from dataclasses import dataclass
from math import ceil
from typing import Any

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector

CREDIT_STEP = 1e-4
"""Energy of one unit of credit [J]. Energy handed over is rounded down to it, so rounding never creates energy."""
LEAST_CONTACT = 0.05
"""Smallest force that counts as contact [N]; less is sensor noise or a remainder within a deadband."""
UNREACHED_S = 0.03
"""Time for which a robot that follows may lag behind a contact that the operator feels already [s]."""
FREE_FORCE = 1.0
"""Largest force on the hand that may last without a contact [N]."""

Surface = Any
"""A received model of a contact, an elastic surface: its `stiffness` [N/m], and `at(tick, position)`, the force without
friction [N] at a tick of the other side and a position [m]."""


@dataclass(frozen=True)
class AccountParameters:
    """What bounds the energy out of the hand (`weberlink.control.account`), in the frame of what is displayed."""

    allowance: float  # energy that the hand may get beyond what it gave [J]
    refill: float  # power with which the allowance returns [W]
    damping: float  # that every hand has at least [N s/m]
    rise: float  # of the force that the hand has not pressed in itself [N/s]


@dataclass(frozen=True)
class SchemeParameters:
    """Parameters of both ends of a scheme."""

    tick_period: float  # of both sides [s]
    coupling: float  # stiffness of the robot towards its command [N/m]
    account: AccountParameters  # of the force on the hand
    delay: float = 0.0  # what look-ahead and play-out of both directions add to the round trip [s]
    longest: float = 1.0  # longest round trip, with that delay [s]


class SentCommands:
    """The commands of the operator's end, and so where the robot was as the newest news of it left.

    One for each tick, of the time `longest` [s] at least; `add` takes in that of this tick [m].
    """

    __slots__ = ("_commands", "_tick_period", "add", "reset")

    def __init__(self, tick_period: float, longest: float) -> None:
        self._tick_period = tick_period
        self._commands: deque[Vector] = deque(maxlen=ceil(longest / tick_period) + 1)
        self.add, self.reset = self._commands.append, self._commands.clear

    def ago(self, time: float) -> Vector:
        """The command of so long ago [s], or the oldest known; there must be one."""
        ticks, commands = round(time / self._tick_period), self._commands
        return commands[-1 - ticks] if ticks < len(commands) else commands[0]


@mypyc_attr(allow_interpreted_subclasses=True)
class Control:
    """What both ends share."""

    __slots__ = ()

    @property
    def energy(self) -> float:
        """What this end may still give [J]; negative for a debt, 0 where it keeps no account."""
        return 0.0

    @property
    def credit(self) -> int:
        """Energy that this end tells the other one of since the session began, in units of `CREDIT_STEP`; never
        decreases."""
        return 0

    def reset(self) -> None:
        """Begin a new session."""

    def resume(self, peer_credit: int) -> None:
        """Continue after an interruption of the session: drop force, motion, model and energy from before.

        A debt and `credit` are kept.

        Args:
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`; all of it is given up.
        """


@mypyc_attr(allow_interpreted_subclasses=True)
class AxesMaster(Control):
    """The operator's end of a scheme for axes that turn: the joints of an arm, or the three of a handle.

    Calls in a tick: `observe`, `render`, `displayed`.
    """

    __slots__ = ()

    def observe(self, position: Any, elapsed: float, tick: float, peer_credit: int, rtt: float | None) -> None:
        """Book the work of the last tick.

        Args:
            position: angles of all axes [rad], of which only the changes count; of a hand, its position [m].
            elapsed: time since the last call [s].
            tick: the tick of the other side from which an update can have arrived by now.
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`.
            rtt: round-trip time [s]; None while unknown.
        """

    def render(self, force: Any) -> Any:
        """The torques [N m] to display, or the force [N], given what was decoded."""
        return force

    def displayed(self, force: Any) -> None:
        """Take in what the device was commanded, and holds until the next tick."""


@mypyc_attr(allow_interpreted_subclasses=True)
class MasterControl(AxesMaster):
    """The operator's end of a scheme for the force on a hand.

    Calls in a tick: `learn` for each update, `observe`, `command`, `render`, `displayed`; and `refute` if that lasts
    without a contact.
    """

    __slots__ = ("_coupling", "_model_stiffness")

    def __init__(self, settings: SchemeParameters) -> None:
        self._model_stiffness = self._coupling = settings.coupling

    def reset(self) -> None:
        self._model_stiffness = self._coupling

    def resume(self, peer_credit: int) -> None:  # noqa: ARG002
        self.reset()

    @property
    def stiffness(self) -> float:
        """Stiffness of the contact by the newest model, or that of the robot's coupling if there is none [N/m]."""
        return self._model_stiffness

    def refute(self) -> None:
        """Let go of what is displayed by a model: it lasts, and the robot's end states no contact. A complete update
        was asked for."""

    def learn(self, surface: Surface, force: Vector, position: Vector) -> None:  # noqa: ARG002
        """Take in an update.

        Args:
            surface: the contact model that it carries; None if it carries none.
            force: force of its newest sample [N].
            position: commanded position of that sample [m]; NaN if neither its predictor nor, by its entry in
                `weberlink.control.table`, the scheme reads it.
        """
        self._model_stiffness = self._coupling if surface is None else surface.stiffness

    def command(self, position: Vector) -> Vector:
        """The position [m] to send to the robot for this position of the device [m]."""
        return position


@mypyc_attr(allow_interpreted_subclasses=True)
class SlaveControl(Control):
    """The teleoperator's end of a scheme. Calls in a tick: `follow`, then `observe` once the robot was read."""

    __slots__ = ()

    def __init__(self, settings: SchemeParameters | None = None) -> None: ...

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, rtt: float | None) -> Vector:  # noqa: ARG002
        """The position to command [m].

        Args:
            target: decoded position of the operator [m].
            here: last commanded position [m].
            elapsed: time since the last call [s].
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`.
            rtt: round-trip time [s]; None while unknown.
        """
        return target

    def observe(self, position: Vector, force: Vector) -> None:
        """Book the work of this tick.

        Args:
            position: commanded position [m].
            force: force of the environment on the robot [N].
        """
