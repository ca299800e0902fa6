"""The operator's side, from device to endpoint."""

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
from weberlink.composition.link import (
    Entropy,
    Stopwatch,
    build_endpoint,
    channels,
    check_axes,
    construct,
    control_settings,
    located,
)
from weberlink.composition.live import build_master_tuning
from weberlink.composition.mapping import build_mapping
from weberlink.configuration import Configuration, ConfigurationError, System


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
    forward, backward = channels(system)
    force_limit = _force_limit(system, device)
    control = build_master_control(system.control.scheme, control_settings(system, force_limit))
    return MasterLoop(
        device=device,
        encoder=Encoder(forward),
        decoder=Decoder(backward),
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
    if system.master.mapping is not None:
        device = build_mapping(system, device)
    _check_range("master.device", device.spec.workspace_m, device.spec.axes, system, channels(system)[0])
    return device


def _force_limit(system: System, device: Device) -> float:
    """Largest force of the robot that may reach the hand, in the robot's frame [N]."""
    mapping = system.master.mapping
    allowed = system.master.limits.force_n / (1.0 if mapping is None else mapping.force_scale)
    return min(allowed, device.spec.force_n) if device.spec.force_feedback else allowed


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
