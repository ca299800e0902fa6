"""What both sides build alike from a configuration: channels, agreement, security, endpoint, emulated faults."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from codec import Channel, force_channel, position_channel
from codec.predictors import Trust
from control.contract import Settings as ControlSettings
from control.table import SCHEMES
from protocol.endpoint import Endpoint
from protocol.events import Address
from protocol.roles import Role
from protocol.security import Security
from weberlink.configuration import Configuration, ConfigurationError, System

Entropy = Callable[[int], bytes]
Stopwatch = Callable[[], float]

P = ParamSpec("P")
R = TypeVar("R")


def located(build: Callable[Concatenate[Configuration, P], R]) -> Callable[Concatenate[Configuration, P], R]:
    """Errors of a builder with the file in front."""

    @wraps(build)
    def build_located(configuration: Configuration, /, *args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return build(configuration, *args, **kwargs)
        except ConfigurationError as error:
            raise ConfigurationError(f"{configuration.path}: {error}") from None

    return build_located


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
        **_flat(system.control.model_dump(mode="json"), "control."),
        **_flat(system.codec.model_dump(mode="json"), "codec."),
    }


@located
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


def build_endpoint(
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
        carries_credit=SCHEMES[system.control.scheme].carries_credit,
    )


def control_settings(system: System, force_range: float) -> ControlSettings:
    """What both sides of the control scheme are built from.

    Args:
        system: both sides.
        force_range: largest force that the wire and the robot can say [N].
    """
    return ControlSettings(
        tick_period=system.tick_period,
        force_range=force_range,
        level=system.control.level_j,
        damping=system.control.damping_n_s_m,
        catch_up_speed=system.slave.limits.approach_speed_m_s,
    )


def construct(where: str, driver: Any, *arguments: Any) -> Any:
    """A driver from its options; what it cannot accept is an error of its place in the file."""
    try:
        return driver(*arguments)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None


def check_axes(where: str, axes: str, system: System) -> None:
    """See that a device or robot moves on every axis that is sent.

    Raises:
        ConfigurationError: naming those that it lacks.
    """
    missing = [axis for axis in system.axes if axis not in axes]
    if missing:
        raise ConfigurationError(f"axes: {where} has no axis {', '.join(missing)}; it has {axes}")


def _flat(tree: dict[str, Any], prefix: str) -> dict[str, object]:
    leaves: dict[str, object] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            leaves |= _flat(value, f"{prefix}{key}.")
        else:
            leaves[f"{prefix}{key}"] = value
    return leaves
