"""The whole architecture on one page: how a configuration becomes the two sides and the link between them."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from codec import Channel, Decoder, Encoder, force_channel, position_channel
from codec.predictors import Trust
from codec.quantizer import INT16_MAX
from master.devices.contract import Device
from master.loop import MasterLoop
from master.safety import ForceGate, ForceLimiter
from protocol.emulation import EmulatedLink, Emulation
from protocol.endpoint import Endpoint
from protocol.events import Address
from protocol.roles import Role
from protocol.security import Security
from protocol.session import FADE_SHARE
from slave.loop import SlaveLoop
from slave.robots.contract import Robot
from slave.safety import CommandGuard, Workspace
from slave.scenes.scene import Scene
from slave.scenes.settings import build
from weberlink.configuration import Configuration, ConfigurationError, System
from weberlink.configuration.model import EmulationSettings

Entropy = Callable[[int], bytes]
Stopwatch = Callable[[], float]


P = ParamSpec("P")
R = TypeVar("R")


def _located(build: Callable[Concatenate[Configuration, P], R]) -> Callable[Concatenate[Configuration, P], R]:
    """Errors of a builder with the file in front."""

    @wraps(build)
    def located(configuration: Configuration, /, *args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return build(configuration, *args, **kwargs)
        except ConfigurationError as error:
            raise ConfigurationError(f"{configuration.path}: {error}") from None

    return located


def channels(system: System) -> tuple[Channel, Channel]:
    """The forward (position) and the backward (force) channel, as both sides build them."""
    force, position = system.codec.force, system.codec.position
    forward = position_channel(
        predictor=position.predictor,
        bank=position.bank,
        weber=position.weber,
        bound=position.bound_m,
        axes=system.axes,
        position_step=position.step_m,
    )
    backward = force_channel(
        predictor=force.predictor,
        bank=force.bank,
        weber=force.weber,
        floor=force.floor_n,
        reference=force.reference,
        axes=system.axes,
        force_step=force.step_n,
        position_step=position.step_m,
        trust=Trust(force.trust.stiffness_n_m, force.trust.radius_m),
    )
    return forward, backward


def agreement(system: System) -> dict[str, object]:
    """What both ends must hold alike, by the path of the field."""
    return {
        "rate_hz": system.rate_hz,
        "axes": system.axes,
        "control.scheme": system.control.scheme,
        **_flat(system.codec.model_dump(mode="json"), "codec."),
    }


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
    return MasterLoop(
        device=device,
        encoder=Encoder(forward),
        decoder=Decoder(backward),
        endpoint=_endpoint(system, Role.INITIATOR, security, entropy, epoch, forward, backward, peer),
        gate=ForceGate(
            ramp=system.master.limits.ramp_ms * 1e-3,
            silence=system.link.silence_ms * 1e-3,
            fade_share=FADE_SHARE,
        ),
        limiter=ForceLimiter(min(system.master.limits.force_n, device.spec.force_n)),
        tick_period=system.tick_period,
        horizon=FADE_SHARE * system.link.silence_ms * 1e-3,
        device_limit=system.master.limits.device_ms * 1e-3,
        stopwatch=stopwatch,
    )


def build_slave(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
) -> SlaveLoop:
    """The teleoperator's side, not yet open.

    Raises:
        ConfigurationError: if the robot or the scene cannot be made as the file asks.
    """
    system, robot = configuration.system, build_robot(configuration)
    forward, backward = channels(system)
    limits = system.slave.limits
    return SlaveLoop(
        robot=robot,
        encoder=Encoder(backward),
        decoder=Decoder(forward),
        endpoint=_endpoint(system, Role.RESPONDER, security, entropy, epoch, backward, forward, None),
        guard=CommandGuard(
            workspace=_workspace(configuration, robot),
            speed=limits.speed_m_s,
            approach_speed=limits.approach_speed_m_s,
            ramp=limits.ramp_ms * 1e-3,
            retract=limits.retract_m if limits.on_silence == "retract" else 0.0,
        ),
        tick_period=system.tick_period,
        horizon=FADE_SHARE * system.link.silence_ms * 1e-3,
        robot_limit=limits.robot_ms * 1e-3,
        stopwatch=stopwatch,
    )


@_located
def build_device(configuration: Configuration) -> Device:
    """The haptic device, not yet open.

    Raises:
        ConfigurationError: if it cannot be made of its options, or the wire cannot say its positions.
    """
    system, part = configuration.system, configuration.device
    assert part is not None
    device: Device = _construct("master.device", part.driver, part.options, system.tick_period)
    _check_range("master.device", device.spec.workspace_m, device.spec.axes, system, channels(system)[0])
    return device


@_located
def build_robot(configuration: Configuration) -> Robot:
    """The robot with the scene that it touches, not yet open.

    Raises:
        ConfigurationError: if either cannot be made of its options.
    """
    system, part = configuration.system, configuration.robot
    assert part is not None
    robot: Robot = _construct("slave.robot", part.driver, part.options, _scene(system), system.tick_period)
    return robot


def try_out(configuration: Configuration) -> None:
    """Build what a run would build, and let go of it: every error of the file shows before a process is started.

    Raises:
        ConfigurationError: as the builders do.
    """
    build_security(configuration)
    if configuration.device is not None:
        build_device(configuration)
    if configuration.robot is not None:
        _workspace(configuration, build_robot(configuration))


@_located
def build_security(configuration: Configuration) -> Security:
    """The security suite that the file asks for; only that one is imported.

    Raises:
        ConfigurationError: if the key file cannot be used.
    """
    link = configuration.system.link
    if link.security == "none":
        from protocol.checksum import Checksum  # noqa: PLC0415

        return Checksum()
    from protocol.keys import KeyFileError, load  # noqa: PLC0415
    from protocol.psk import PresharedKey  # noqa: PLC0415

    assert link.key_file is not None
    try:
        return PresharedKey(load(link.key_file))
    except KeyFileError as error:
        raise ConfigurationError(f"link.key_file: {error}") from None


@_located
def build_scene(configuration: Configuration) -> Scene | None:
    """What there is to touch; None where the file names nothing.

    Raises:
        ConfigurationError: if an object of the scene cannot be made.
    """
    return _scene(configuration.system)


def _scene(system: System) -> Scene | None:
    if not system.slave.scene:
        return None
    try:
        return build(system.slave.scene)
    except ValueError as error:
        raise ConfigurationError(f"slave.scene: {error}") from None


def build_links(
    emulation: EmulationSettings | None, uniform: tuple[Callable[[], float], Callable[[], float]], epoch: float
) -> tuple[EmulatedLink[Address], EmulatedLink[Address]]:
    """The forward and the backward link, each with its own source of chance."""
    faults = build_emulation(emulation or EmulationSettings())
    return EmulatedLink(faults, uniform[0], epoch), EmulatedLink(faults, uniform[1], epoch)


def build_emulation(settings: EmulationSettings) -> Emulation:
    return Emulation(
        delay_s=settings.delay_ms * 1e-3,
        jitter_s=settings.jitter_ms * 1e-3,
        loss=settings.loss,
        burst=settings.burst,
        reorder=settings.reorder,
        duplicate=settings.duplicate,
        corrupt=settings.corrupt,
        rate_bit_s=None if settings.rate_kbit_s is None else settings.rate_kbit_s * 1e3,
        blackouts=settings.blackouts_s,
    )


def _endpoint(
    system: System,
    role: Role,
    security: Security,
    entropy: Entropy,
    epoch: float,
    outgoing: Channel,
    incoming: Channel,
    peer: Address | None,
) -> Endpoint:
    return Endpoint(
        role=role,
        agreement=agreement(system),
        outgoing_values=outgoing.level_count,
        incoming_values=incoming.level_count,
        security=security,
        entropy=entropy,
        epoch=epoch,
        tick_period=system.tick_period,
        silence=system.link.silence_ms * 1e-3,
        peer=peer,
    )


def _construct(where: str, driver: Any, *arguments: Any) -> Any:
    """A driver from its options; what it cannot accept is an error of its place in the file."""
    try:
        return driver(*arguments)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None


def _check_range(where: str, workspace: Workspace, axes: str, system: System, channel: Channel) -> None:
    """A wire that cannot say a position of the device would move the robot elsewhere."""
    missing = [axis for axis in system.axes if axis not in axes]
    if missing:
        raise ConfigurationError(f"axes: {where} has no axis {', '.join(missing)}; it has {axes}")
    limit = channel.value_quantizer.limit
    reach = max(abs(corner["xyz".index(axis)]) for corner in workspace for axis in system.axes)
    if reach > limit:
        raise ConfigurationError(
            f"codec.position.step_m: spans {limit:g} m but {where} reaches {reach:g} m; "
            f"use a step of at least {reach / INT16_MAX:.2g}"
        )


@_located
def _workspace(configuration: Configuration, robot: Robot) -> Workspace:
    """Where the robot may be commanded to: its own workspace within that of the file."""
    return _intersection(_corners(configuration.system.slave.limits.workspace_m), robot.spec.workspace_m)


def _corners(intervals: tuple[tuple[float, float], ...]) -> Workspace:
    (x0, x1), (y0, y1), (z0, z1) = intervals
    return (x0, y0, z0), (x1, y1, z1)


def _intersection(a: Workspace, b: Workspace) -> Workspace:
    low, high = (
        tuple(choose(pair) for pair in zip(mine, theirs, strict=True))
        for choose, mine, theirs in ((max, a[0], b[0]), (min, a[1], b[1]))
    )
    if not all(lowest < highest for lowest, highest in zip(low, high, strict=True)):
        raise ConfigurationError("slave.limits.workspace_m: leaves nothing of the robot's own workspace")
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def _flat(tree: dict[str, Any], prefix: str) -> dict[str, object]:
    leaves: dict[str, object] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            leaves |= _flat(value, f"{prefix}{key}.")
        else:
            leaves[f"{prefix}{key}"] = value
    return leaves
