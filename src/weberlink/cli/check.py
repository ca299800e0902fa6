"""The `check` command: the parts that a file composes, their cost on this machine, and advice as warnings.

The parts are built as the daemons build them; nothing is opened or sent.
"""

from collections.abc import Iterator
from math import cos, pi, sin
from statistics import median
from time import perf_counter
from typing import Protocol, runtime_checkable

from weberlink.codec import Channel
from weberlink.codec.replay import code
from weberlink.config import Configuration, System
from weberlink.config.model import ControlSettings, MappingSettings, PredictedSettings
from weberlink.control.table import SCHEMES
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import Device
from weberlink.protocol.wire import UpdateLayout
from weberlink.session.advice import advise
from weberlink.session.composition.channels import channels, streams
from weberlink.session.composition.link import build_security
from weberlink.session.composition.master import build_device
from weberlink.session.composition.slave import build_robot, build_scene
from weberlink.session.composition.trial import try_out
from weberlink.slave.robots.contract import Robot, RobotSpec, TimedRobot
from weberlink.slave.scenes.scene import Scene

UDP_IP_BYTES = 28
SAMPLES = 2000
"""Ticks of the cost measurement."""


@runtime_checkable
class Described(Protocol):
    """A part that can describe what it chose."""

    def description(self) -> str: ...


def describe(configuration: Configuration) -> Iterator[str]:
    """Describe a configuration, line by line.

    Raises:
        ConfigurationError: a part cannot be built as the file asks.
    """
    system = configuration.system
    advice = advise(try_out(configuration))
    security = build_security(configuration)
    yield f"{configuration.path}: valid"
    if system.codec.joints is None:
        yield from _hand_and_tool(configuration, security.tag_size)
    else:
        from weberlink.cli.check_arms import arms  # noqa: PLC0415 - for arms alone

        yield from arms(configuration, security.tag_size, _link(system))
    for warning in advice:
        yield f"warning   {warning}"


def _hand_and_tool(configuration: Configuration, tag: int) -> Iterator[str]:
    system = configuration.system
    device = None if configuration.device is None else build_device(configuration)
    robot = None if configuration.robot is None else build_robot(configuration)
    if isinstance(robot, TimedRobot):
        robot.measure_steps(perf_counter)  # as the daemon does
    forward, backward = channels(system)
    shape = backward.deadband.describe()
    scene = build_scene(configuration)
    yield from _sides(system, device, robot)
    yield from _link(system)
    yield f"force     {_coding(system.codec.force.predictor, backward)}; k = {system.codec.force.weber:g}, " + (
        f"floor {system.codec.force.floor_n:g} N, reference {system.codec.force.reference}"
        + ("" if shape == "isotropic" else f"; {shape}")
        + _most(system.codec.force)
    )
    yield f"          update of {_sizes(backward, tag, system)} bytes of UDP payload"
    position = system.codec.position
    yield f"position  {_coding(position.predictor, forward)}; bound {1e3 * position.bound_m:g} mm{_most(position)}"
    yield f"          update of {_sizes(forward, tag, system)} bytes of UDP payload"
    yield from _rotation(system, tag)
    yield f"cost      codec {_codec_us(backward):.1f} us per tick (force channel, encode and decode)"
    if system.codec.rotation is not None:
        torque_us = _codec_us(streams(system)[1][1])
        yield f"          codec {torque_us:.1f} us per tick more (torque channel)"
    if scene is not None:
        yield f"          scene {_scene_us(scene):.1f} us per tick at its surface"
    uncoded = _uncoded_kbit(system, tag)
    yield f"          an update every tick would be {uncoded:.0f} kbit/s both ways, IP headers included"


def _sides(system: System, device: Device | None, robot: Robot | None) -> Iterator[str]:
    yield f"rate      {system.rate_hz:g} Hz, axes {system.axes}"
    if device is not None:
        yield (f"master    device {system.master.device.driver}{_detail(device)}, {_displayed(system, device)}")
        if system.master.mapping is not None:
            yield f"          mapped: {_mapping(system.master.mapping)}"
    if robot is not None:
        silence = system.slave.limits.on_silence
        yield f"slave     robot {system.slave.robot.driver}{_detail(robot)}; on silence {silence}"
        yield from _measured(robot.spec)
    for thing in system.slave.scene:
        extras = [name for name in ("friction", "damping_n_s_m", "motion") if getattr(thing, name) is not None]
        with_extras = f" with {', '.join(extras)}" if extras else ""
        yield f"scene     {thing.shape}, {thing.stiffness_n_m:g} N/m{with_extras}"


def _displayed(system: System, device: Device) -> str:
    """The largest force and torque on the hand: the smaller of the limits of the file and of the device."""
    limits, spec = system.master.limits, device.spec
    scale = 1.0 if system.master.mapping is None else system.master.mapping.force_scale
    force = min(limits.force_n, spec.force_n * scale) if spec.force_feedback else 0.0
    if system.codec.rotation is None:
        return f"force at most {force:g} N"
    return f"force at most {force:g} N, torque at most {min(limits.torque_nm, spec.torque_n_m * scale):g} N m"


def _detail(part: Device | Robot) -> str:
    return f", {part.description()}" if isinstance(part, Described) else ""


def _mapping(mapping: MappingSettings) -> str:
    parts = [f"{name} {value}" for name, value in mapping.model_dump(exclude_defaults=True, exclude={"walls"}).items()]
    if mapping.walls is not None:
        parts.append(f"walls of {mapping.walls.stiffness_n_m:g} N/m")
    return ", ".join(parts) or "one to one"


def _measured(spec: RobotSpec) -> Iterator[str]:
    """Lag and accuracy of a robot's readings, unless ideal."""
    absolute, relative = spec.force_error
    if spec.lag_s > 0.0:
        yield f"          readings lag by {1e3 * spec.lag_s:.1f} ms, at {spec.rate_hz:g} Hz"
    if absolute > 0.0 or relative > 0.0:
        yield f"          force known to +-({absolute:.2g} N + {100 * relative:.0f} %)"


def _link(system: System) -> Iterator[str]:
    link = system.link
    finder = link.finder
    yield f"link      {link.slave}, security {link.security}" if finder is None else f"link      by {finder.driver}"
    yield f"limits    {link.silence_ms:g} ms of silence, round trips up to {link.longest_round_trip_ms:g} ms"
    if link.playout_ms > 0.0:
        yield f"          every update is used {link.playout_ms:g} ms later than on its fastest way"
    if link.emulate is not None:
        changed = link.emulate.model_dump(exclude_defaults=True)
        yield f"          emulated: {', '.join(f'{name} {value}' for name, value in changed.items()) or 'no faults'}"
    yield from _control(system.control, turns=system.codec.rotation is not None)


def _control(control: ControlSettings, *, turns: bool) -> Iterator[str]:
    yield f"control   {control.scheme}: {SCHEMES[control.scheme].does}"
    if control.scheme == "none":
        yield "          nothing bounds the energy"
    elif control.scheme == "bounded":
        most = f"{1e3 * control.allowance_j:g} mJ + {1e3 * control.refill_w:g} mW x time"
        yield f"          the hand gets at most {most} + {control.damping_n_s_m:g} N s/m x its squared speed,"
        yield f"          integrated, more than it gave, beside what the scene gives{'; as much by torques' * turns}"


def _coding(predictor: str, channel: Channel) -> str:
    return predictor if len(channel.bank) == 1 else f"{predictor} of {', '.join(channel.bank)}"


def _most(settings: PredictedSettings) -> str:
    """The bounded rate of updates, if there is one."""
    most = settings.max_updates_per_s
    return "" if most is None else f"; at most {most:g} updates/s"


def _sizes(channel: Channel, tag: int, system: System) -> str:
    shortest, longest = (size + tag for size in _layout(channel, system).lengths)
    return f"{shortest} to {longest}"


def _layout(channel: Channel, system: System) -> UpdateLayout:
    return UpdateLayout(
        channel.forms,
        carries_credit=SCHEMES[system.control.scheme].carries_credit,
        acks=1 if system.codec.rotation is None else 2,
    )


def _rotation(system: System, tag: int) -> Iterator[str]:
    """The channels of the rotation."""
    coded = system.codec.rotation
    if coded is None:
        return
    (_, orientation), (_, torque) = streams(system)
    yield (
        f"rotation  torque {_coding(coded.torque.predictor, torque)}; k = {coded.torque.weber:g}, "
        f"floor {coded.torque.floor_nm:g} N m, reference {coded.torque.reference}{_most(coded.torque)}"
    )
    yield f"          update of {_sizes(torque, tag, system)} bytes of UDP payload"
    bound = f"bound {coded.orientation.bound_rad:g} rad{_most(coded.orientation)}"
    yield f"          orientation {_coding(coded.orientation.predictor, orientation)}; {bound}"
    yield f"          update of {_sizes(orientation, tag, system)} bytes of UDP payload"


def _uncoded_kbit(system: System, tag: int) -> float:
    sizes = [UpdateLayout(each.forms).lengths[0] for way in streams(system) for each in way]
    octets = sum(size + tag + UDP_IP_BYTES for size in sizes)
    return octets * 8 * system.rate_hz / 1e3


def _codec_us(channel: Channel) -> float:
    """Median time per tick [us] on a stroke over a soft wall, which sends as often as real contact does."""
    samples = ((force, position) for position, force in map(_stroke, range(SAMPLES)))
    return median(coded.seconds for coded in code(channel, samples, stopwatch=perf_counter)) * 1e6


def _scene_us(scene: Scene) -> float:
    times = []
    for tick in range(SAMPLES):
        position, _ = _stroke(tick)
        began = perf_counter()
        scene.force(position, 1e-3)
        times.append(perf_counter() - began)
    scene.reset()
    return median(times) * 1e6


def _stroke(tick: int) -> tuple[Vector, Vector]:
    """Position on a circle of 3 cm that dips 4 mm below z = 0, and the reaction of a wall of 500 N/m there."""
    angle = 2.0 * pi * tick * 1e-3
    position = (0.03 * cos(angle), 0.03 * sin(angle), -0.002 + 0.002 * sin(3.0 * angle))
    return position, ((0.0, 0.0, -500.0 * position[2]) if position[2] < 0.0 else ZERO)
