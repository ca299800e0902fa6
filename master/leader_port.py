"""The operator's end of the link with an arm: its angles are sensed, received torques are displayed joint by joint."""

from collections.abc import Callable, Sequence
from math import inf
from typing import ClassVar

from weberlink.arms.contract import ArmFault, ArmReading, LeaderArm
from weberlink.arms.sensor import AxesSensor, sensors
from weberlink.control.ends import AxesMaster
from weberlink.geometry.joints import Joints, is_finite
from weberlink.master.operator_end import OperatorEnd
from weberlink.master.safety import ContactLimiter, ForceGate, TorqueLimiter
from weberlink.protocol.endpoint import Endpoint
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row, placed


class PressedAxes:
    """How much of the deadbands of some angles may stay unsent while the follower presses on something.

    There, an error e of an angle changes the torque by up to K e, with the stiffness K of the follower. So an error
    stays unsent only if K e is within the deadband of the displayed torque.

    Args:
        bounds: deadbands of the angles [rad], > 0.
        coupling: stiffness of the follower towards its command [N m/rad], > 0.
        torque_bound: deadband of a torque of this size on this axis [N m].
    """

    def __init__(self, bounds: Joints, coupling: Joints, torque_bound: Callable[[int, float], float]) -> None:
        self._axes = [
            (index, 1.0 / (bound * stiffness))
            for index, (bound, stiffness) in enumerate(zip(bounds, coupling, strict=True))
        ]
        self._torque_bound = torque_bound

    def share(self, torques: Joints) -> float:
        """The largest share of all deadbands, for these torques as displayed [N m]; inf where nothing is pressed."""
        most = inf
        for index, scale in self._axes:
            torque = abs(torques[index])
            bound = self._torque_bound(index, torque)
            if torque > bound:
                most = min(most, bound * scale)
        return most


class LeaderPort(OperatorEnd):
    """A leader arm in the frame of the follower; a `weberlink.session.port.Port`.

    Vectors have one entry for each axis: the joints in order and, where there is one, the gripper last.

    Args:
        arm: not yet open.
        control: the operator's end of the control scheme, on all axes.
        endpoint: measures the link.
        gate: fades all torques in and out.
        most: largest torques [N m], >= 0; 0 for an axis that displays none.
        slew: fastest change of the torques [N m/s], > 0.
        button: only while it is held, the follower follows and torque is displayed; None for always.
        pressed: of the joints and, with one, of the gripper; None for a follower whose stiffness is not known.
        contacts: end torques that no contact founds, of the joints and, with one, of the gripper.
        least: smallest torques of all axes that state a contact [N m].
        delay: what play-out adds to the round trip [s].

    Attributes:
        joints: the sensor of the channel of the joints.
        gripper: that of the gripper; None without one.
        angles: as measured [rad].
        decoded: torques before all limits [N m].
        output: torques as commanded [N m].

    Raises:
        ValueError: the limits do not fit the arm.
    """

    fault: ClassVar[type[ArmFault]] = ArmFault

    def __init__(
        self,
        *,
        arm: LeaderArm,
        control: AxesMaster,
        endpoint: Endpoint,
        gate: ForceGate,
        most: Joints,
        slew: Joints,
        button: int | None = None,
        pressed: Sequence[PressedAxes | None] = (),
        contacts: Sequence[ContactLimiter] = (),
        least: Joints = (),
        delay: float = 0.0,
    ) -> None:
        super().__init__(arm, gate, button)
        spec = arm.spec
        if len(most) != spec.axes:
            raise ValueError(f"{spec.name} has {spec.axes} axes, but there are {len(most)} torque limits")
        self.arm, self._control = arm, control
        self.controls = (control,)
        self._sensors = sensors("angles", len(spec.joints), spec.axes)
        self.joints: AxesSensor = self._sensors[0]
        self.gripper: AxesSensor | None = self._sensors[1] if spec.gripper else None
        self._limiter = TorqueLimiter(most, slew)
        self._displays = any(limit > 0.0 for limit in most)
        self._endpoint = endpoint
        self._pressed = [
            (sensor, axes) for sensor, axes in zip(self._sensors, pressed, strict=False) if axes is not None
        ]
        self._delay = delay
        self._contacts = [
            (sensor, contact, sensor.part(least)) for sensor, contact in zip(self._sensors, contacts, strict=False)
        ]
        self._nothing = [sensor.value for sensor in self._sensors]
        self._none: Joints = (0.0,) * spec.axes
        self.angles = self.decoded = self.output = self._none

    def _forget(self) -> None:
        super()._forget()
        for _, contact, _ in self._contacts:
            contact.reset()

    @property
    def angle_range(self) -> tuple[Joints, Joints]:
        """Least and largest angles of all axes [rad]."""
        return self.arm.spec.lower, self.arm.spec.upper

    def accept(self, reading: ArmReading) -> bool:
        self.angles = reading.angles
        return super().accept(reading)

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - energy is booked in every tick
        self._control.observe(self.angles, elapsed)
        for sensor in self._sensors:
            sensor.keep(self.angles)
        for sensor, axes in self._pressed:
            sensor.most = axes.share(sensor.part(self.decoded))
        return 0

    def actuate(
        self,
        values: Sequence[Joints | None],
        now: float,
        elapsed: float,  # noqa: ARG002
        step: float,
        *,
        engaged: bool,
    ) -> None:
        gate, limiter, control = self.gate, self._limiter, self._control
        slew_step = step if gate.gain > 0.0 else None
        gain = gate.update(engaged=engaged, age=now - self._endpoint.liveness.in_touch_at, elapsed=step)
        self.decoded = self._all(values)
        rendered = control.render(self.decoded)
        wanted = rendered if is_finite(rendered) else self._none
        limited = limiter.limit(wanted, slew_step)
        output = limited if gain == 1.0 else tuple([torque * gain for torque in limited])
        if slew_step is not None:
            output = self._founded(output, wanted, slew_step)
        self.output = output
        control.displayed(output)
        if self._displays:
            self.arm.display(output, now)
        self.slew_ticks += limiter.held_back
        self.clipped = limiter.clipped

    def _founded(self, output: Joints, wanted: Joints, elapsed: float) -> Joints:
        """What may be displayed: of each channel, as far as it states a torque; a largest torque counts, not a length.

        Args:
            output: torques that are to be displayed [N m].
            wanted: before all limits [N m].
            elapsed: time since the last call [s].
        """
        founded: Joints = ()
        unfounded = False
        for sensor, contact, least in self._contacts:
            part, limits = sensor.part(output), sensor.part(self._limiter.most)
            asked = max([min(abs(torque), most) for torque, most in zip(sensor.part(wanted), limits, strict=True)])
            if asked > contact.free or not contact.quiet:
                endpoint = self._endpoint
                round_trip = None if endpoint.clock.rtt is None else endpoint.clock.rtt + self._delay
                decoded = sensor.part(self.decoded)
                stated = 0.0 if any(abs(torque) > most for torque, most in zip(decoded, least, strict=True)) else inf
                most = contact.bound(asked, elapsed, round_trip, stated=stated)
                largest = max([abs(torque) for torque in part])
                if largest > most:
                    part = tuple([torque * most / largest for torque in part])
                unfounded |= contact.unfounded
            founded += part
        if unfounded and not self.unfounded:
            self._control.resume(self._endpoint.credit.known)
        self.unfounded = unfounded
        return founded + output[len(founded) :]

    def _all(self, values: Sequence[Joints | None]) -> Joints:
        """The decoded torques of all axes [N m]; none where nothing, or nothing finite, was decoded."""
        torques: Joints = ()
        for index, nothing in enumerate(self._nothing):
            value = values[index] if index < len(values) else None
            torques += nothing if value is None or not is_finite(value) else value
        return torques

    def report(self, row: Row, *, is_led: bool) -> None:  # noqa: ARG002 - this end leads
        joints = len(self.joints.value)
        row.joint_position, row.joint_raw = placed(self.angles, joints), placed(self.angles, joints)
        row.joint_decoded, row.joint_output = placed(self.decoded, joints), placed(self.output, joints)
        row.slew_ticks, row.clipped = self.slew_ticks, self.clipped
        row.ramping = self.gate.ramping if self.enabled else RELEASED
        row.buttons = self.buttons & 0xFF

    def halt(self, now: float) -> None:
        if self._displays:
            self.arm.display(self._none, now)
