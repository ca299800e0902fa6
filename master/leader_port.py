"""The operator's end of the link with an arm: its angles are sensed, received torques are displayed joint by joint."""

from collections.abc import Callable, Sequence
from math import inf
from typing import ClassVar

from weberlink.arms.contract import ArmFault, ArmReading, LeaderArm
from weberlink.arms.sensor import AxesSensor
from weberlink.control.ends import AxesMaster
from weberlink.geometry.joints import Joints
from weberlink.master.gate import OutputGate
from weberlink.master.operator_port import Display, OperatorPort
from weberlink.protocol.endpoint import Endpoint
from weberlink.telemetry.row import Row, placed


class PressedAxes:
    """How much of the deadbands `bounds` [rad] of some angles may stay unsent while the follower presses on something.

    There, an error e of an angle changes the torque by up to K e, with the stiffness K of the follower [N m/rad]. So an
    error stays unsent only if K e is within the deadband of the displayed torque, `torque_bound` of axis and torque [N
    m].
    """

    def __init__(self, bounds: Joints, coupling: Joints, torque_bound: Callable[[int, float], float]) -> None:
        self._scales = [1.0 / (bound * stiffness) for bound, stiffness in zip(bounds, coupling, strict=True)]
        self._torque_bound = torque_bound

    def share(self, torques: Joints) -> float:
        """The largest share of all deadbands, for these torques as displayed [N m]; inf where nothing is pressed."""
        most = inf
        for index, scale in enumerate(self._scales):
            torque = abs(torques[index])
            bound = self._torque_bound(index, torque)
            if torque > bound:
                most = min(most, bound * scale)
        return most


class LeaderPort(OperatorPort):
    """A leader arm in the frame of the follower.

    Vectors have one entry for each axis: the joints in order and, where there is one, the gripper last; `sensors` and
    `pressed` one for each channel, `pressed` with None for a follower whose stiffness is not known.
    """

    fault: ClassVar[type[Exception]] = ArmFault

    def __init__(
        self,
        arm: LeaderArm,
        *,
        control: AxesMaster,
        endpoint: Endpoint,
        gate: OutputGate,
        sensors: Sequence[AxesSensor],
        button: int | None = None,
        pressed: Sequence[PressedAxes | None] = (),
        displays_torque: bool = True,
    ) -> None:
        display = Display(control, [len(sensor.value) for sensor in sensors], arm.display if displays_torque else None)
        super().__init__(arm, displays=[display], controls=[control], endpoint=endpoint, gate=gate, button=button)
        self._control, self._sensors, self._display = control, sensors, display
        self._pressed = [(sensor, axes) for sensor, axes in zip(sensors, pressed, strict=False) if axes is not None]
        self.angles = display.output
        self.angle_range = arm.spec.lower, arm.spec.upper

    def accept(self, reading: ArmReading) -> bool:
        self.angles = reading.angles
        return super().accept(reading)

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - energy is booked in every tick
        self._control.observe(self.angles, elapsed)
        for sensor, axes in self._pressed:
            sensor.most = axes.share(sensor.part(self._display.decoded))
        return self._control.credit

    def report(self, row: Row, *, is_led: bool) -> None:
        super().report(row, is_led=is_led)
        joints = len(self._sensors[0].value)
        row.joint_position = row.joint_raw = placed(self.angles, joints)
        row.joint_decoded = placed(self._display.decoded, joints)
        row.joint_output = placed(self._display.output, joints)
