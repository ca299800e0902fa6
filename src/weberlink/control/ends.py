"""The two ends of a control scheme, and what they do under `none`: the decoded force is displayed, and the decoded
position followed.

Every scheme inherits from these. Without control is for links with a delay that is not felt; `weberlink study
stability` measures at which stiffness and delay the loop is stable.
"""

from weberlink.compiled import mypyc_attr
from weberlink.control.contract import SchemeParameters, WallModel
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import Vector


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
class MasterControl(Control):
    """The operator's end of a scheme.

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

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:  # noqa: ARG002
        """Take in an update.

        Args:
            surface: the contact model that it carries; None if it carries none.
            force: force of its newest sample [N].
            position: commanded position of that sample [m]; NaN if neither its predictor nor, by its entry in
                `weberlink.control.table`, the scheme reads it.
        """
        self._model_stiffness = self._coupling if surface is None else surface.stiffness

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, rtt: float | None) -> None:
        """Book the work of the last tick.

        Args:
            position: position of the device [m].
            elapsed: time since the last call [s].
            tick: the tick of the other side from which an update can have arrived by now.
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`.
            rtt: round-trip time [s]; None while unknown.
        """

    def command(self, position: Vector) -> Vector:
        """The position [m] to send to the robot for this position of the device [m]."""
        return position

    def render(self, force: Vector) -> Vector:
        """The force to display [N], given the decoded one [N]."""
        return force

    def displayed(self, force: Vector) -> None:
        """Take in the commanded force of the device [N], which is held until the next tick."""


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


@mypyc_attr(allow_interpreted_subclasses=True)
class AxesMaster(Control):
    """The operator's end of a scheme for axes that turn: the joints of an arm, or the three of a handle.

    Calls in a tick: `observe`, `render`, `displayed`.
    """

    __slots__ = ()

    def observe(self, position: Joints, elapsed: float, tick: float, peer_credit: int, rtt: float | None) -> None:
        """Book the work of the last tick; as of `MasterControl`, but for the angles of all axes [rad]: only their
        changes count."""

    def render(self, torque: Joints) -> Joints:
        """The torques to display [N m], given the decoded ones [N m]."""
        return torque

    def displayed(self, torque: Joints) -> None:
        """Take in the commanded torques [N m], which are held until the next tick."""
