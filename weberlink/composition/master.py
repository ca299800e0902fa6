"""The operator's side, from device to endpoint."""

from typing import TYPE_CHECKING

from codec import Channel, Decoder, Encoder
from codec.quantizer import INT16_MAX
from codec.vector import Vector
from control.table import build_master_control
from master.devices.contract import Device
from master.loop import MasterLoop
from master.safety import ForceGate, ForceLimiter
from protocol.events import Address
from protocol.roles import Role
from protocol.security import Security
from protocol.session import FADE_SHARE
from weberlink.composition.guardian import check_force_ends
from weberlink.composition.link import (
    Entropy,
    Stopwatch,
    build_endpoint,
    check_axes,
    construct,
    control_settings,
    located,
    streams,
)
from weberlink.composition.live import build_master_tuning
from weberlink.composition.mapping import build_mapping
from weberlink.configuration import Configuration, ConfigurationError, System

if TYPE_CHECKING:
    from master.rotation import HandRotation


def build_master(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
    peer: Address,
) -> MasterLoop:
    """The operator's side, not yet open.

    Raises:
        ConfigurationError: if the device cannot do what the file asks.
    """
    system, device = configuration.system, build_device(configuration)
    forward, backward = streams(system)
    force_limit = _force_limit(system, device)
    control = build_master_control(system.control.scheme, control_settings(system, force_limit))
    return MasterLoop(
        device=device,
        encoder=Encoder(forward[0]),
        decoder=Decoder(backward[0]),
        control=control,
        tuning=build_master_tuning(system, control),
        endpoint=build_endpoint(system, Role.INITIATOR, security, entropy, epoch, forward, backward, peer),
        gate=ForceGate(
            ramp=system.master.limits.ramp_ms * 1e-3,
            silence=system.link.silence_ms * 1e-3,
            fade_share=FADE_SHARE,
        ),
        limiter=ForceLimiter(force_limit),
        tick_period=system.tick_period,
        horizon=FADE_SHARE * system.link.silence_ms * 1e-3,
        device_limit=system.master.limits.device_ms * 1e-3,
        stopwatch=stopwatch,
        rotation=None if system.codec.rotation is None else _build_rotation(system, device),
    )


def _build_rotation(system: System, device: Device) -> "HandRotation":
    from master.devices.contract import TorqueDevice  # noqa: PLC0415 - for six degrees of freedom alone
    from master.rotation import HandRotation  # noqa: PLC0415

    (_, orientation), (_, torque) = streams(system)
    displayed = device.spec.torque_n_m
    allowed = system.master.limits.torque_nm / _force_scale(system)
    return HandRotation(
        device=device if isinstance(device, TorqueDevice) and displayed > 0.0 else None,
        encoder=Encoder(orientation),
        decoder=Decoder(torque),
        limiter=ForceLimiter(min(allowed, displayed) if displayed > 0.0 else allowed),
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
