"""The coded streams of a configuration, of a hand and of an arm, as both sides build them."""

from dataclasses import replace
from typing import Any

from weberlink.codec import Channel, force_channel, position_channel
from weberlink.codec.channel import joint_channel
from weberlink.codec.deadband import Deadband, DeadbandSetup, ForceDeadband
from weberlink.codec.predictors import FitLimits
from weberlink.codec.rate import UpdateRate
from weberlink.codec.sample import INT16_MAX
from weberlink.config import ConfigurationError, System
from weberlink.config.joints import AngleCodecSettings, JointTorqueCodecSettings, per_axis
from weberlink.config.model import ControlSettings, ForceCodecSettings, MappingSettings, MotionCodecSettings
from weberlink.config.settings import PredictedSettings
from weberlink.control.contract import LEAST_CONTACT, AccountParameters
from weberlink.control.table import SCHEMES


def force_deadband(force: ForceCodecSettings, tick_period: float, weber: float) -> Deadband:
    """The shape that the file asks for, at a Weber factor that a session may have changed."""
    setup = DeadbandSetup(weber, force.floor_n, force.reference, tick_period, force.deadband)
    return force.deadband.deadband.configured(setup)


def _pace(
    settings: PredictedSettings | AngleCodecSettings | JointTorqueCodecSettings, system: System
) -> dict[str, Any]:
    """What the channels of every signal have: tick period, and rate of updates."""
    most, period = settings.max_updates_per_s, system.tick_period
    return {"rate": None if most is None else UpdateRate.limited_to(most, period), "tick_period": period}


def _ticks(length_ms: float, system: System) -> int:
    """A time in whole ticks; at least one if it is not 0."""
    return max(1, round(length_ms * 1e-3 * system.rate_hz)) if length_ms > 0.0 else 0


def playout_ticks(system: System) -> int:
    """How long updates wait before they are used, in whole ticks."""
    return _ticks(system.link.playout_ms, system)


def least_contact(system: System) -> float:
    """Smallest force that states a contact [N]: a smaller one may be left over within the deadband."""
    return max(LEAST_CONTACT, system.codec.force.floor_n)


def signal_delay(system: System) -> float:
    """What look-ahead and play-out of both directions add to the round trip of the signals [s]."""
    ahead = sum(channels[0].lookahead for channels in streams(system))
    return (ahead + 2 * playout_ticks(system)) * system.tick_period


def longest_round_trip(system: System) -> float:
    """Round trip of the signals beyond which no session goes on, at whatever age its loop is [s]."""
    return (system.link.silence_ms + system.link.longest_round_trip_ms) * 1e-3 + signal_delay(system)


def streams(system: System) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """All forward and all backward channels by stream.

    Those of a hand are the translation and, where the file asks for it, the rotation: an orientation is coded as a
    position and a torque as a force, in radians and newton metres. Those of an arm are its joints and, where it has
    one, its gripper."""
    codec = system.codec
    if codec.joints is not None:
        angles = (
            joint_channel(
                **_pace(group.angle, system),
                predictor=group.angle.predictor,
                bounds=per_axis(group.angle.bound_rad, count),
                step=group.angle.step_rad,
            )
            for _, group, count in codec.arm
        )
        return tuple(angles), tuple(_torques(group.torque, count, system) for _, group, count in codec.arm)
    force, position = codec.force, codec.position
    forward = _motion(position, system, bound=position.bound_m, axes=system.axes, position_step=position.step_m)
    backward = _effort(
        force,
        system,
        deadband=force_deadband(force, system.tick_period, force.weber),
        axes=system.axes,
        force_step=force.step_n,
        position_step=position.step_m,
    )
    forward = replace(forward, lookahead=_ticks(position.lookahead_ms, system))
    backward = replace(
        backward,
        fit_limits=FitLimits(force.trust.stiffness_n_m, force.trust.radius_m),
        smoothing=_ticks(force.smooth_ms, system),
        every_position=SCHEMES[system.control.scheme].reads_position,
        lookahead=_ticks(force.lookahead_ms, system),
    )
    if codec.rotation is None:
        return (forward,), (backward,)
    torque, orientation = codec.rotation.torque, codec.rotation.orientation
    deadband, step = ForceDeadband(torque.weber, torque.floor_nm, torque.reference), orientation.step_rad
    turning = _motion(orientation, system, bound=orientation.bound_rad, position_step=step)
    twisting = _effort(torque, system, deadband=deadband, force_step=torque.step_nm, position_step=step)
    return (forward, turning), (backward, twisting)


def _motion(settings: MotionCodecSettings, system: System, **more: Any) -> Channel:
    made = position_channel(predictor=settings.predictor, bank=settings.bank, weber=settings.weber, **more)
    return replace(made, **_pace(settings, system))


def _effort(settings: PredictedSettings, system: System, **more: Any) -> Channel:
    return replace(force_channel(predictor=settings.predictor, bank=settings.bank, **more), **_pace(settings, system))


def _torques(settings: JointTorqueCodecSettings, count: int, system: System, weber: float | None = None) -> Channel:
    return joint_channel(
        **_pace(settings, system),
        predictor=settings.predictor,
        bounds=per_axis(settings.floor_nm, count),
        weber=settings.weber if weber is None else weber,
        step=settings.step_nm,
        rest=(0.0,) * count,
    )


def check_span(field: str, channel: Channel, says: str, most: float, unit: str) -> None:
    """A wire that cannot say a value of a part would move the other end elsewhere: raises ConfigurationError for the
    field of its step."""
    limit = channel.value_quantizer.limit
    if most > limit:
        raise ConfigurationError(
            f"{field}: spans {limit:g} {unit} but {says} {most:g} {unit}; use a step of at least {most / INT16_MAX:.2g}"
        )


def felt_deadbands(system: System, weber: float) -> list[Deadband]:
    """Of the force, or of the parts of an arm's torques, at a Weber factor that a session may have changed."""
    joints = system.codec.joints
    if joints is None:
        return [force_deadband(system.codec.force, system.tick_period, weber)]
    channel = _torques(joints.torque, len(joints.names), system, weber)
    return [part.deadband for part in (channel, *channel.more)]


def banks(system: System) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
    """Names of the predictors of force and torque, None without a rotation; of an arm, those of its joints' torques."""
    _, (first, *second) = streams(system)
    return first.bank, second[0].bank if system.codec.rotation is not None else None


def account(control: ControlSettings, mapping: MappingSettings | None, *, turns: bool = False) -> AccountParameters:
    """What bounds the energy out of the hand, in the robot's frame, where lengths and forces are scaled, but no angles.

    Args:
        mapping: of the hand's frame to the robot's; None where they are one.
        turns: whether it is that of a torque.
    """
    mapping = mapping or MappingSettings()
    force_scale, scale = mapping.force_scale, 1.0 if turns else mapping.scale
    energy = scale / force_scale
    return AccountParameters(
        allowance=energy * control.allowance_j,
        refill=energy * control.refill_w,
        damping=control.damping_n_s_m / (scale * force_scale),
        rise=control.rise_n_s / force_scale,
    )
