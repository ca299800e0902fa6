"""The coded channels and the force deadband of a configuration, as both sides build them."""

from collections.abc import Callable

from weberlink.codec import Channel, force_channel, position_channel
from weberlink.codec.deadband import Deadband, DeadbandSetup
from weberlink.codec.predictors import FitLimits
from weberlink.codec.smoothing import Smoothing
from weberlink.control.table import SCHEMES
from weberlink.geometry.vector import Vector
from weberlink.system.configuration import System


def force_deadband(system: System, weber: float) -> Deadband:
    """The shape that the file asks for, at a Weber factor that a session may have changed."""
    force = system.codec.force
    settings = force.deadband
    return settings.deadband.configured(
        DeadbandSetup(weber, force.floor_n, force.reference, system.tick_period, settings.options)
    )


def measure_of(system: System) -> Callable[[Vector, Vector], float] | None:
    """How the deadband of the file measures an error; None where that is the distance, which is quicker without."""
    deadband = force_deadband(system, system.codec.force.weber)
    return None if deadband.is_ball else deadband.error


def channels(system: System) -> tuple[Channel, Channel]:
    """The forward (position) and the backward (force) channel."""
    force, position = system.codec.force, system.codec.position
    forward = position_channel(
        predictor=position.predictor,
        bank=position.bank,
        weber=position.weber,
        bound=position.bound_m,
        axes=system.axes,
        position_step=position.step_m,
        tick_period=system.tick_period,
    )
    backward = force_channel(
        predictor=force.predictor,
        bank=force.bank,
        axes=system.axes,
        force_step=force.step_n,
        position_step=position.step_m,
        fit_limits=FitLimits(force.trust.stiffness_n_m, force.trust.radius_m),
        deadband=force_deadband(system, force.weber),
        smoothing=_smoothing(system),
        tick_period=system.tick_period,
        every_position=SCHEMES[system.control.scheme].reads_position,
    )
    return forward, backward


def _smoothing(system: System) -> Smoothing | None:
    """Of the force, in ticks."""
    length = system.codec.force.smooth_ms
    return Smoothing(max(1, round(length * 1e-3 * system.rate_hz))) if length > 0.0 else None


def streams(system: System) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """All forward and all backward channels by stream: the translation and, where the file asks for it, the rotation.

    An orientation is coded as a position and a torque as a force, in radians and newton metres.
    """
    forward, backward = channels(system)
    if system.codec.rotation is None:
        return (forward,), (backward,)
    torque, orientation = system.codec.rotation.torque, system.codec.rotation.orientation
    turning = position_channel(
        predictor=orientation.predictor,
        bank=orientation.bank,
        weber=orientation.weber,
        bound=orientation.bound_rad,
        position_step=orientation.step_rad,
        tick_period=system.tick_period,
    )
    twisting = force_channel(
        predictor=torque.predictor,
        bank=torque.bank,
        weber=torque.weber,
        floor=torque.floor_nm,
        reference=torque.reference,
        force_step=torque.step_nm,
        position_step=orientation.step_rad,
        tick_period=system.tick_period,
    )
    return (forward, turning), (backward, twisting)


def banks(system: System) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
    """Names of the predictors of the force channel and of the torque channel; None where there is no rotation."""
    _, (force, *rotation) = streams(system)
    return force.bank, rotation[0].bank if rotation else None
