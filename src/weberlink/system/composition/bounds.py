"""What a file asks beyond what device, robot and rate can do: the sentences that `check` and a run say before it.

A wall is displayed a tick after the position that it answers, so the passivity bound is that of a delay of one tick
(`weberlink.control.passivity`). A setting that is wrong whatever the parts are is refused by the model of the file.
"""

from collections.abc import Iterator
from math import ceil, floor, inf, isinf, log10

from weberlink.control.passivity import passivity_limit
from weberlink.master.devices.contract import Device
from weberlink.slave.robots.contract import Robot
from weberlink.slave.scenes.settings import ObjectSettings
from weberlink.system.composition.coupling import FIT_MARGIN, STATED
from weberlink.system.configuration import Configuration, System

LOOP_TICKS = 1
"""Delay of the loop without a network, in ticks."""
ROUNDING = 1.0 + 1e-9


def beyond(configuration: Configuration, device: Device | None, robot: Robot | None) -> Iterator[str]:
    """Say what is beyond the bounds, and what to do; what depends on a part that is not given is left out.

    Args:
        configuration: of both sides.
        device: in the robot's frame.
        robot: with its scene.
    """
    system = configuration.system
    if device is not None:
        yield from _limits(system, device)
        yield from _walls(system, device)
    yield from _delayed(configuration, robot)
    if robot is None:
        return
    trip, most = system.slave.limits.trip_n, robot.spec.force_n
    if trip is not None and trip > most:
        yield f"slave.limits.trip_n {trip:g}: {robot.spec.name} measures at most {most:g} N and never trips"
    if isinf(robot.spec.stiffness_n_m):
        yield f"slave.robot: {robot.spec.name} states no stiffness, so slave.limits.contact_n cannot act"
        return
    yield from _commands(system, robot.spec.stiffness_n_m)
    if device is not None:
        yield from _contact(configuration, device, robot.spec.stiffness_n_m)


def _limits(system: System, device: Device) -> Iterator[str]:
    """Limits of the file above those of the device, which therefore protect nobody."""
    limits, spec = system.master.limits, device.spec
    scale = 1.0 if system.master.mapping is None else system.master.mapping.force_scale
    for name, unit, limit, most in (
        ("force_n", "N", limits.force_n, spec.force_n * scale),
        ("torque_nm", "N m", limits.torque_nm, spec.torque_n_m * scale),
    ):
        if name in limits.model_fields_set and 0.0 < most * ROUNDING < limit:
            yield (
                f"master.limits.{name} {limit:g}: {spec.name} displays at most {most:.3g} {unit}, so this limit does "
                f"nothing; use at most {most:.3g}"
            )


def _contact(configuration: Configuration, device: Device, stiffness: float) -> Iterator[str]:
    """A robot or a scene that is stiffer or more damped than what the device displays at the file's rate."""
    system, damping, passive = configuration.system, _device_damping(configuration), inf
    if damping == 0.0:
        yield "master.device.hand.damping_n_s_m 0: no wall is passive on it; use for example 8"
        return
    if damping is not None:
        passive = _passive_stiffness(configuration, damping, stiffness)
        for index, thing in enumerate(system.slave.scene):
            felt = _felt_damping(thing, stiffness)
            if felt > 0.0 and felt >= damping:
                most = _at_most(damping * (thing.damping_n_s_m or 0.0) / felt)
                yield (
                    f"slave.scene.{index}.damping_n_s_m: {felt:.3g} N s/m are felt on a device and hand of "
                    f"{damping:.3g} N s/m, which gives energy to the hand at any stiffness; use less than {most}"
                )
        if passive == 0.0:
            return
    stable = device.spec.stiffness_n_m * min(1.0, system.rate_hz / device.spec.rate_hz)
    displayed = min(stable, passive)
    if stiffness <= displayed * ROUNDING or displayed == 0.0:
        return
    why = " passively, b > K T (1/2 + 1) + B" if passive < stable else ""
    energy = "control.scheme none does not bound the energy beyond; " if system.control.scheme == "none" else ""
    faster = system.rate_hz * stiffness / displayed
    raised = f"raise rate_hz to {ceil(faster)}, or " if device.spec.stiffness_n_m >= stiffness and faster <= 1e4 else ""
    yield (
        f"slave.robot.{STATED} {stiffness:g}: at rate_hz {system.rate_hz:g} {device.spec.name} displays at most "
        f"{_at_most(displayed)} N/m{why}; {energy}{raised}set it to at most {_at_most(displayed / FIT_MARGIN)}"
    )


def _delayed(configuration: Configuration, robot: Robot | None) -> Iterator[str]:
    """A delay at which a contact may give energy, under the scheme that does not bound it."""
    system, emulate = configuration.system, configuration.system.link.emulate
    delay_ms = 0.0 if emulate is None else sum(way.delay_ms + way.jitter_ms for way in emulate.directions)
    if delay_ms == 0.0 or system.control.scheme != "none":
        return
    stiffness = inf if robot is None else robot.spec.stiffness_n_m
    damping = _device_damping(configuration)
    passive = 0.0 if damping is None else _passive_stiffness(configuration, damping, stiffness, delay_ms * 1e-3)
    if stiffness > passive * ROUNDING:
        beyond_it = f" beyond {_at_most(passive)} N/m" if passive > 0.0 else ""
        yield (
            f"control.scheme none: a round trip of {delay_ms:g} ms can make contact unstable, its energy is not bounded"
            f"{beyond_it}; use tdpa, mmt or auto"
        )


def _passive_stiffness(configuration: Configuration, damping: float, stiffness: float, delay: float = 0.0) -> float:
    """What a device and hand display passively of the file's scene [N/m]; may be 0.

    Args:
        configuration: of both sides.
        damping: of device and hand [N s/m].
        stiffness: of the robot [N/m].
        delay: round trip of the network [s].
    """
    system = configuration.system
    wall_damping = max((_felt_damping(thing, stiffness) for thing in system.slave.scene), default=0.0)
    ticks = LOOP_TICKS + delay / system.tick_period
    return passivity_limit(damping, system.tick_period, delay_ticks=ticks, wall_damping=wall_damping)


def _device_damping(configuration: Configuration) -> float | None:
    """Of device and hand, in the robot's frame [N s/m]; None where it is not known."""
    part, mapping = configuration.device, configuration.system.master.mapping
    damping = getattr(getattr(part.options, "hand", None), "damping_at_handle", None) if part is not None else None
    scale = 1.0 if mapping is None else mapping.scale * mapping.force_scale
    return None if damping is None else damping / scale


def _felt_damping(thing: ObjectSettings, stiffness: float) -> float:
    """The damping of an object as it is felt through a robot of this stiffness [N/m]: it falls with its own [N s/m]."""
    return (thing.damping_n_s_m or 0.0) * min(1.0, stiffness / thing.stiffness_n_m)


def _commands(system: System, stiffness: float) -> Iterator[str]:
    """Errors of position that the robot turns into more force than may stay unsent."""
    codec = system.codec
    floor_n = codec.force.floor_n
    largest = max(codec.force.weber * system.master.limits.force_n, floor_n)
    bound, step = codec.position.bound_m, codec.position.step_m
    if bound * stiffness > largest * ROUNDING:
        yield (
            f"codec.position.bound_m {bound:g}: until a contact is felt the robot may press {bound * stiffness:.3g} N "
            f"into it, more than the deadband of the largest force ({largest:.3g} N); use at most "
            f"{_at_most(largest / stiffness)}"
        )
    if 0.0 < floor_n < 0.5 * step * stiffness:
        yield (
            f"codec.position.step_m {step:g}: half a step is {0.5 * step * stiffness:.2g} N at the robot, above "
            f"codec.force.floor_n; use at most {_at_most(2.0 * floor_n / stiffness)}"
        )


def _walls(system: System, device: Device) -> Iterator[str]:
    mapping = system.master.mapping
    if mapping is None or mapping.walls is None:
        return
    stiffness, most = mapping.walls.stiffness_n_m, device.spec.stiffness_n_m * mapping.scale * mapping.force_scale
    if stiffness > most * ROUNDING:
        limit = _at_most(most)
        yield (
            f"master.mapping.walls.stiffness_n_m {stiffness:g}: {device.spec.name} displays at most {limit} N/m; use "
            f"at most {limit}"
        )


def _at_most(value: float) -> str:
    """A largest value in two digits, rounded down, so that a file that follows the advice keeps the bound."""
    if value <= 0.0:
        return "0"
    digit = floor(log10(value)) - 1
    return f"{floor(value * 10.0**-digit * ROUNDING) * 10.0**digit:g}"
