"""The operator's side, from device to endpoint."""

from math import inf
from typing import TYPE_CHECKING

from weberlink.codec import Channel, Decoder, Encoder
from weberlink.codec.quantizer import INT16_MAX
from weberlink.control.table import build_master_control
from weberlink.geometry.vector import Vector
from weberlink.master.devices.contract import Device
from weberlink.master.loop import MasterLoop
from weberlink.master.safety import ForceGate, ForceLimiter, SlewLimiter
from weberlink.protocol import Role
from weberlink.protocol.events import Address
from weberlink.protocol.liveness import FADE_SHARE, HORIZON_SHARE
from weberlink.protocol.security import Security
from weberlink.system.composition.channels import streams
from weberlink.system.composition.guardian import check_force_ends
from weberlink.system.composition.link import (
    ANONYMOUS,
    Entropy,
    Identity,
    Stopwatch,
    build_endpoint,
    check_axes,
    construct,
    control_settings,
    located,
)
from weberlink.system.composition.live import build_master_tuning
from weberlink.system.composition.mapping import build_mapping
from weberlink.system.configuration import Configuration, ConfigurationError, System

if TYPE_CHECKING:
    from weberlink.master.rotation import HandRotation

FASTEST_TOUCH = 1.0
"""Speed of a hand that meets a wall [m/s], from which the default slew limit follows."""


def build_master(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
    peer: Address,
    identity: Identity = ANONYMOUS,
) -> MasterLoop:
    """The operator's side, not yet open.

    Raises:
        ConfigurationError: if the device cannot do what the file asks.
    """
    system, device = configuration.system, build_device(configuration)
    forward, backward = streams(system)
    force_limit = _force_limit(system, device)
    control = build_master_control(system.control.scheme, control_settings(system, force_limit))
    engage = system.master.engage
    return MasterLoop(
        device=device,
        encoder=Encoder(forward[0]),
        decoder=Decoder(backward[0]),
        control=control,
        tuning=build_master_tuning(system, control),
        endpoint=build_endpoint(system, Role.INITIATOR, security, entropy, epoch, forward, backward, peer, identity),
        gate=ForceGate(
            ramp=system.master.limits.ramp_ms * 1e-3,
            silence=system.link.silence_ms * 1e-3,
            fade_share=FADE_SHARE,
        ),
        limiter=ForceLimiter(force_limit),
        slew=SlewLimiter(_force_slew(system, device)),
        tick_period=system.tick_period,
        horizon=HORIZON_SHARE * system.link.silence_ms * 1e-3,
        device_limit=system.master.limits.device_ms * 1e-3,
        stopwatch=stopwatch,
        button=None if engage is None else engage.button,
        rotation=None if system.codec.rotation is None else _build_rotation(system, device),
    )


def _build_rotation(system: System, device: Device) -> "HandRotation":
    from weberlink.master.devices.contract import TorqueDevice  # noqa: PLC0415 - for six degrees of freedom alone
    from weberlink.master.rotation import HandRotation  # noqa: PLC0415

    (_, orientation), (_, torque) = streams(system)
    displayed = device.spec.torque_n_m
    allowed = system.master.limits.torque_nm / _force_scale(system)
    return HandRotation(
        device=device if isinstance(device, TorqueDevice) and displayed > 0.0 else None,
        encoder=Encoder(orientation),
        decoder=Decoder(torque),
        limiter=ForceLimiter(min(allowed, displayed) if displayed > 0.0 else allowed),
        slew=SlewLimiter(_torque_slew(system, device)),
    )


@located
def build_device(configuration: Configuration) -> Device:
    """The haptic device in the robot's frame, not yet open.

    Raises:
        ConfigurationError: if it cannot be made of its options, or the wire cannot say its positions.
    """
    system, part = configuration.system, configuration.device
    assert part is not None
    device: Device = construct("master.device", part.driver, part.options, system.tick_period)
    check_force_ends(device, system.master.device.driver, system.master.accept_no_watchdog)
    if system.master.mapping is not None:
        device = build_mapping(system, device)
    _check_button(system, device)
    _check_range("master.device", device.spec.workspace_m, device.spec.axes, system, streams(system)[0][0])
    if system.codec.rotation is not None and not device.spec.orientation:
        raise ConfigurationError(
            f"codec.rotation: master.device driver {system.master.device.driver}, as it is set here, reports no "
            "orientation; use one that does, or leave codec.rotation out"
        )
    return device


def _force_limit(system: System, device: Device) -> float:
    """Largest force of the robot that may reach the hand, in the robot's frame [N]."""
    allowed = system.master.limits.force_n / _force_scale(system)
    return min(allowed, device.spec.force_n) if device.spec.force_feedback else allowed


def _force_slew(system: System, device: Device) -> float:
    """Fastest change of the robot's force on the way to the hand, in the robot's frame [N/s]."""
    limit, spec = system.master.limits.slew_n_s, device.spec
    if limit is not None:
        return limit / _force_scale(system)
    if not spec.force_feedback:
        return inf
    mapping = system.master.mapping
    return spec.stiffness_n_m * FASTEST_TOUCH * (1.0 if mapping is None else mapping.scale)


def _torque_slew(system: System, device: Device) -> float:
    """Fastest change of torque, in the robot's frame [N m/s].

    No device tells how stiff a rotation it displays; so torque rises to its largest in the time in which force does.
    """
    limit, spec = system.master.limits.slew_nm_s, device.spec
    if limit is not None:
        return limit / _force_scale(system)
    if not (spec.torque_n_m > 0.0 and spec.force_n > 0.0):
        return inf
    return spec.torque_n_m * _force_slew(system, device) / spec.force_n


def _check_button(system: System, device: Device) -> None:
    """A dead-man button must be there, and must not be the clutch too."""
    engage, mapping, spec = system.master.engage, system.master.mapping, device.spec
    if engage is None:
        return
    if engage.button >= spec.buttons:
        has = "no button" if not spec.buttons else f"the buttons 0 to {spec.buttons - 1}"
        raise ConfigurationError(f"master.engage.button: {spec.name} has {has}, not {engage.button}")
    if mapping is not None and mapping.clutch is not None and mapping.clutch.button == engage.button:
        raise ConfigurationError(f"master.engage.button: {engage.button} is the button of master.mapping.clutch")


def _force_scale(system: System) -> float:
    """Newtons on the hand for a newton on the robot."""
    mapping = system.master.mapping
    return 1.0 if mapping is None else mapping.force_scale


def _check_range(where: str, workspace: tuple[Vector, Vector], axes: str, system: System, channel: Channel) -> None:
    """A wire that cannot say a position of the device would move the robot elsewhere."""
    check_axes(where, axes, system)
    limit = channel.value_quantizer.limit
    reach = max(abs(corner["xyz".index(axis)]) for corner in workspace for axis in system.axes)
    if reach > limit:
        raise ConfigurationError(
            f"codec.position.step_m: spans {limit:g} m but {where} reaches {reach:g} m; "
            f"use a step of at least {reach / INT16_MAX:.2g}"
        )
