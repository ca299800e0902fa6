"""Builds the operator's end with a haptic device, from a configuration."""

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING

from weberlink.codec import Decoder, Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.config import Configuration, ConfigurationError, System
from weberlink.control.contract import FREE_FORCE, SentCommands
from weberlink.control.table import build_master_control
from weberlink.master.devices.contract import Device, DeviceFault, DeviceSpec, TorqueDevice
from weberlink.master.gate import Bound, ContactLimiter, HandContact, OutputGate
from weberlink.master.operator_port import Display, HandPosition, OperatorPort
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.liveness import FADE_SHARE
from weberlink.session.channels import IncomingChannel
from weberlink.session.composition.channels import (
    account,
    check_span,
    least_contact,
    longest_round_trip,
    playout_ticks,
    signal_delay,
    streams,
)
from weberlink.session.composition.coupling import coupling
from weberlink.session.composition.link import (
    build_control,
    build_driver,
    build_tuning,
    check_axes,
)
from weberlink.session.side import Parts

if TYPE_CHECKING:
    from weberlink.arms.contract import Arm, ArmSpec

FASTEST_TOUCH = 1.0  # speed of a hand that meets a wall [m/s], from which the default slew limit follows


def operator_port(
    system: System,
    device: "Device | Arm",
    displays: Sequence[Display],
    bounds: Sequence[Bound],
    endpoint: Endpoint,
    fault: type[Exception] = DeviceFault,
) -> OperatorPort:
    silence, ramp, engage = system.link.silence_ms * 1e-3, system.master.limits.ramp_ms * 1e-3, system.master.engage
    gate = OutputGate(bounds, ramp=ramp, silence=silence, fade_share=FADE_SHARE)
    button = None if engage is None else engage.button
    return OperatorPort(device, displays=displays, endpoint=endpoint, gate=gate, button=button, fault=fault)


def build_hand(configuration: Configuration, endpoint: Endpoint) -> Parts:
    """The port of a haptic device, its channels out and in, and the settings that may change."""
    system, device = configuration.system, build_device(configuration)
    forward, backward = streams(system)
    # Limits of the robot's force, in its frame.
    force_limit = system.master.limits.force_n / system.master.frame_map.force_scale
    if device.spec.force_feedback:
        force_limit = min(force_limit, device.spec.force_n)
    control = build_control(system, build_master_control, coupling(configuration, device))
    force_decoder = Decoder(backward[0])
    # The largest force without a contact, in the robot's frame.
    free, longest = FREE_FORCE / system.master.frame_map.force_scale, longest_round_trip(system)
    force = system.codec.force
    hand = HandPosition(Encoder(forward[0]), control, force.weber, force.floor_n, free)
    tuning = build_tuning(system, force_decoder, hand)
    contact = HandContact(
        ContactLimiter(force_limit, free, longest),
        force_decoder,
        endpoint,
        hand,
        least=least_contact(system),
        sent=SentCommands(system.tick_period, longest),
        delay=signal_delay(system),
        playout=playout_ticks(system),
    )
    limits = system.master.limits
    ramp = limits.ramp_ms * 1e-3
    bounds = [Bound((force_limit,), (_force_slew(system, device),), ramp, contact=contact)]
    displays = [Display(control, [hand], device.command)]
    hand.felt = displays[0]
    outgoing: list[OutgoingChannel] = [hand]
    incoming = [IncomingChannel(force_decoder, hand, control)]
    if system.codec.rotation is not None:
        from weberlink.control.axes import HANDLE, build_axes  # noqa: PLC0415 - for six degrees of freedom alone
        from weberlink.master.rotation import HandOrientation  # noqa: PLC0415 - likewise

        orientation = HandOrientation(Encoder(forward[1]))
        outgoing.append(orientation)
        incoming.append(IncomingChannel(Decoder(backward[1]), orientation))
        torques = build_axes(system.control.scheme, HANDLE, account(system.control, system.master.mapping, turns=True))
        displayed = device.spec.torque_n_m
        most = limits.torque_nm / system.master.frame_map.force_scale
        most = min(most, displayed) if displayed > 0.0 else most
        bounds.append(Bound((most,), (_torque_slew(system, device),), ramp))
        turn = device.turn if isinstance(device, TorqueDevice) and displayed > 0.0 else None
        displays.append(Display(torques, [orientation], turn, first=1))
    return Parts(operator_port(system, device, displays, bounds, endpoint), outgoing, incoming, tuning)


def build_device(configuration: Configuration) -> Device:
    """The haptic device in the robot's frame, not yet open; raises ConfigurationError if it cannot be made of its
    options, or the wire cannot say its positions."""
    system, part = configuration.system, configuration.device
    assert part is not None
    device: Device = build_driver("master.device", part.driver, part.options, system.tick_period, contract=Device)
    check_force_ends(device, system.master.device.driver, system.master.accept_no_watchdog)
    if system.master.mapping is not None:
        device = _mapped(system, device)
    check_button(system, device.spec)
    push, limit = device.spec.push_n, system.master.limits.force_n
    if push >= limit:  # the displayed force is cut to the limit, and would never stop such a push
        raise ConfigurationError(
            f"master.limits.force_n {limit:g}: {device.spec.name} pushes with {push:g} N and stops only at a force of "
            f"this size; use more, or less master.device.push_n"
        )
    _check_range(device.spec, system)
    if system.codec.rotation is not None and not device.spec.orientation:
        raise ConfigurationError(
            f"codec.rotation: master.device driver {system.master.device.driver}, as it is set here, reports no "
            "orientation; use one that does, or leave codec.rotation out"
        )
    return device


def _force_slew(system: System, device: Device) -> float:
    """Fastest change of the robot's force on the way to the hand, in the robot's frame [N/s]."""
    limit, spec = system.master.limits.slew_n_s, device.spec
    if limit is not None:
        return limit / system.master.frame_map.force_scale
    if not spec.force_feedback:
        return inf
    return spec.stiffness_n_m * FASTEST_TOUCH * system.master.frame_map.scale


def _torque_slew(system: System, device: Device) -> float:
    """Fastest change of torque, in the robot's frame [N m/s]."""
    limit, spec = system.master.limits.slew_nm_s, device.spec
    if limit is not None:
        return limit / system.master.frame_map.force_scale
    if not (spec.torque_n_m > 0.0 and spec.force_n > 0.0):
        return inf
    # No device tells how stiff a rotation it displays; so torque rises to its largest in the time in which force does.
    return spec.torque_n_m * _force_slew(system, device) / spec.force_n


def check_button(system: System, spec: "DeviceSpec | ArmSpec") -> None:
    """A dead-man button must be there, and must not be the clutch too."""
    engage, mapping = system.master.engage, system.master.mapping
    if engage is None:
        return
    if engage.button >= spec.buttons:
        has = "no button" if not spec.buttons else f"the buttons 0 to {spec.buttons - 1}"
        raise ConfigurationError(f"master.engage.button: {spec.name} has {has}, not {engage.button}")
    if mapping is not None and mapping.clutch is not None and mapping.clutch.button == engage.button:
        raise ConfigurationError(f"master.engage.button: {engage.button} is the button of master.mapping.clutch")


def _check_range(spec: DeviceSpec, system: System) -> None:
    check_axes("master.device", spec.axes, system)
    reach = max(abs(corner["xyz".index(axis)]) for corner in spec.workspace_m for axis in system.axes)
    check_span("codec.position.step_m", streams(system)[0][0], "master.device reaches", reach, "m")
    bound = system.codec.position.bound_m
    if bound >= reach:
        raise ConfigurationError(
            f"codec.position.bound_m {bound:g}: nothing would be sent, master.device reaches {reach:g} m; use less"
        )


def _mapped(system: System, device: Device) -> Device:
    """The device in the robot's frame; raises ConfigurationError if the device has no such button."""
    from weberlink.master.mapping.mapped_device import Clutch, FrameMap, MappedDevice, Walls  # noqa: PLC0415

    mapping, limits = system.master.mapping, system.master.limits
    assert mapping is not None
    clutch = walls = None
    if mapping.clutch is not None:
        button = mapping.clutch.button
        if button >= device.spec.buttons:
            raise ConfigurationError(
                f"master.mapping.clutch.button: {device.spec.name} has {device.spec.buttons} buttons, none is {button}"
            )
        clutch = Clutch(button)
    if mapping.walls is not None:
        (x0, x1), (y0, y1), (z0, z1) = mapping.walls.box_m or system.slave.limits.workspace_m
        walls = Walls(((x0, y0, z0), (x1, y1, z1)), mapping.walls.stiffness_n_m)
    return MappedDevice(
        device,
        FrameMap(mapping.rotation_deg, mapping.scale, mapping.force_scale, mapping.offset_m),
        clutch=clutch,
        walls=walls,
        force_limit=limits.force_n,
        ramp=limits.ramp_ms * 1e-3,
    )


def check_force_ends(device: "Device | Arm", driver: str, accepted: str | None) -> None:
    """See that the board of a device, without its mapping, removes the force by itself, or that a guardian process
    does; raises ConfigurationError unless this driver is `accepted` without either (`master.accept_no_watchdog`)."""
    spec = device.spec
    ends = spec.watchdog_s is not None or getattr(device, "guarded", False)
    if spec.force_feedback and not ends and accepted != driver:
        raise ConfigurationError(
            f"master.device: if this host stops, {driver} keeps its last force: its driver states no watchdog and has "
            f"no guardian (see docs/how-to/driver.md); to accept that, set master.accept_no_watchdog: {driver}"
        )
