"""Advice before a run: what is allowed in a file and yet hinders what is felt, as a list of rules.

`check` prints it as warnings; `master`, `slave`, `loopback`, `simulate` and `try` say it once. A rule is one function:
it gets the file and the parts that it needs, and for a setting that hinders it yields one line of field, value, reason
and remedy. To add one, write the function and name it in `RULES`. A setting that is wrong whatever the parts are is
refused by the model of the file instead.

A wall is displayed a tick after the position that it answers, so the passivity bound is that of a delay of one tick
(`weberlink.control.account`).
"""

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from math import ceil, floor, inf, isinf, log10
from operator import mul, truediv
from statistics import median
from timeit import repeat
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit

from weberlink.codec.choice import CHOICES
from weberlink.codec.predictors import PREDICTORS
from weberlink.config import Configuration, ConfigurationError, System
from weberlink.config.joints import per_axis
from weberlink.config.loading import Part
from weberlink.config.model import (
    PERCEPTUAL_WEBER_LIMIT,
    EmulationSettings,
    MasterSettings,
    SlaveSettings,
    is_placeholder,
    split_address,
)
from weberlink.control.account import passivity_limit
from weberlink.control.table import SCHEMES, ends_of
from weberlink.master.devices import DEVICES
from weberlink.master.devices.contract import Device
from weberlink.session.composition.coupling import FIT_MARGIN, STATED
from weberlink.session.composition.link import build_driver, build_security, with_file_name
from weberlink.session.composition.master import build_device
from weberlink.session.composition.slave import build_robot, workspace_of
from weberlink.session.ending import PLACEHOLDER
from weberlink.slave.robots import ROBOTS
from weberlink.slave.robots.contract import Robot
from weberlink.slave.scenes.settings import ObjectSettings
from weberlink.text import is_loopback

if TYPE_CHECKING:
    from weberlink.arms.contract import ArmSpec

LOOP_TICKS = 1  # delay of the loop without a network, in ticks
ROUNDING = 1.0 + 1e-9
SILENCE_TICKS = 5  # ticks that the silence limit should span: both ends look at the link in ticks
USUAL_RATE_HZ = 1000.0
UNKNOWN_BORNE = 0.008
"""Round trip that a usual hand bears on a usual wall without control [s]: 8 N s/m on 500 N/m, with a margin of two."""
TICKS = 600  # whose run time is measured, in 0.1 s or less
TICK_SHARE = 1 / 3
"""Share of a period that the work of a tick may take; the rest is for a late start, and for all else that runs."""


class DryRun(NamedTuple):
    """A file and what was built of it; None for a part of the other side, and of another kind of session."""

    configuration: Configuration  # of one side or both
    device: Device | None = None  # in the robot's frame
    robot: Robot | None = None  # with its scene
    leader: "ArmSpec | None" = None  # the arm of the operator's side
    follower: "ArmSpec | None" = None  # the arm of the teleoperator's side

    @property
    def system(self) -> System:
        return self.configuration.system

    @property
    def is_of_arms(self) -> bool:
        return self.system.codec.joints is not None


@with_file_name
def dry_run(configuration: Configuration) -> DryRun:
    """Build what a run would build, so that every error of the file shows before a process is started; raises
    ConfigurationError as the builders do; or for a port that nobody could find, or a key that nobody else has, where
    one side runs alone."""
    link, scheme = configuration.system.link, configuration.system.control.scheme
    build_security(configuration)
    if scheme not in SCHEMES.built_in:
        build_driver("control.scheme", ends_of, scheme)
    has_device, has_robot = configuration.device is not None, configuration.robot is not None
    if configuration.system.codec.joints is not None:
        from weberlink.session.composition.arms import build_follower, build_leader  # noqa: PLC0415 - for arms alone

        leader = build_leader(configuration).spec if has_device else None
        parts = DryRun(configuration, None, None, leader, build_follower(configuration).spec if has_robot else None)
    else:
        device = build_device(configuration) if has_device else None
        parts = DryRun(configuration, device, build_robot(configuration) if has_robot else None)
        if parts.robot is not None:
            workspace_of(configuration.system, parts.robot)
    for field, address, is_alone in (
        ("link.slave", link.slave, not has_robot),
        ("link.listen", link.listen, not has_device),
    ):
        if is_alone and split_address(address)[1] == 0:
            raise ConfigurationError(f"{field}: port 0 is for loopback; expected the port that both sides know")
    if link.security == "session" and not (has_device and has_robot):
        raise ConfigurationError(
            "link.security: session is for weberlink loopback, which runs both sides; "
            "for one side write psk, with key_file (weberlink keygen KEYFILE)"
        )
    return parts


def advise(parts: DryRun) -> list[str]:
    """What to say of a file before a run, one line each."""
    lines: list[str] = []
    for rule, *needs in RULES:
        needed = [getattr(parts, need) for need in needs]
        lines += [] if None in needed else rule(parts, *needed)
    return lines


# --- what device and robot cannot do


def _device(parts: DryRun, device: Device) -> Iterator[str]:
    spec, turns = device.spec, parts.system.codec.rotation is not None
    if spec.push_n > 0.0 or not spec.force_feedback:
        pushes = f"the force resists its rate, and a full deflection holds {spec.push_n:g} N"
        felt = pushes if spec.push_n > 0.0 else "nothing is felt"
        yield f"master.device: {spec.name} has no force feedback; {felt}"
    if turns and spec.torque_n_m == 0.0:
        yield f"master.device: {spec.name} has no torque feedback; it turns the tool and feels no torque"
    if spec.note:
        yield f"master.device: {spec.note}"


def _robot(parts: DryRun, robot: Robot) -> Iterator[str]:
    spec, trip = robot.spec, parts.system.slave.limits.trip_n
    if not spec.force_sensing:
        yield f"slave.robot: {spec.name} senses no force; nothing is felt"
    if spec.note:
        yield f"slave.robot: {spec.note}"
    if isinf(spec.stiffness_n_m):
        yield f"slave.robot: {spec.name} states no stiffness, so slave.limits.contact_n cannot act"
    if trip is not None and trip > spec.force_n:
        yield f"slave.limits.trip_n {trip:g}: {spec.name} measures at most {spec.force_n:g} N and never trips"


def _arms(parts: DryRun) -> Iterator[str]:
    arms = (("master.device", parts.leader, "displays"), ("slave.robot", parts.follower, "measures"))
    for where, spec, cannot in arms:
        if spec is None:
            continue
        if not spec.force_feedback:
            yield f"{where}: {spec.name} {cannot} no torque; nothing is felt"
        elif not spec.calibrated:
            yield f"{where}: the torques of {spec.name} follow from data sheets, not from a calibration"
        if spec.note:
            yield f"{where}: {spec.note}"


# --- what device, robot and rate cannot display


def _limits(parts: DryRun, device: Device) -> Iterator[str]:
    """Limits of the file above those of the device, which therefore protect nobody; and walls that are too stiff."""
    master, spec = parts.system.master, device.spec
    limits, mapping, scale = master.limits, master.frame_map, master.frame_map.force_scale
    for name, unit, limit, most in (
        ("force_n", "N", limits.force_n, spec.force_n * scale),
        ("torque_nm", "N m", limits.torque_nm, spec.torque_n_m * scale),
    ):
        if name in limits.model_fields_set and 0.0 < most * ROUNDING < limit:
            yield (
                f"master.limits.{name} {limit:g}: {spec.name} displays at most {most:.3g} {unit}, so this limit does "
                f"nothing; use at most {most:.3g}"
            )
    most = spec.stiffness_n_m * mapping.scale * scale
    if mapping.walls is not None and mapping.walls.stiffness_n_m > most * ROUNDING:
        yield (
            f"master.mapping.walls.stiffness_n_m {mapping.walls.stiffness_n_m:g}: {spec.name} displays at most "
            f"{_at_most(most)} N/m; use at most {_at_most(most)}"
        )


def _contact(parts: DryRun, device: Device, robot: Robot) -> Iterator[str]:
    """A robot or a scene that is stiffer or more damped than what the device displays at the file's rate."""
    configuration, system = parts.configuration, parts.system
    if isinf(robot.spec.stiffness_n_m):
        return
    stiffness, damping, passive = robot.spec.stiffness_n_m, _device_damping(configuration), inf
    if damping == 0.0:
        yield "master.device.hand.damping_n_s_m 0: no wall is passive on it; use for example 8"
        return
    if damping is not None:
        wall = _wall_damping(system, stiffness)
        passive = passivity_limit(damping, system.tick_period, delay_ticks=LOOP_TICKS, wall_damping=wall)
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


def _device_damping(configuration: Configuration) -> float | None:
    """Of device and hand, in the robot's frame [N s/m]; None where it is not known."""
    part, mapping = configuration.device, configuration.system.master.frame_map
    damping = getattr(getattr(part.options, "hand", None), "damping_at_handle", None) if part is not None else None
    return None if damping is None else damping / (mapping.scale * mapping.force_scale)


def _felt_damping(thing: ObjectSettings, stiffness: float) -> float:
    """The damping of an object as it is felt through a robot of this stiffness [N/m]: it falls with its own [N s/m]."""
    return (thing.damping_n_s_m or 0.0) * min(1.0, stiffness / thing.stiffness_n_m)


def _wall_damping(system: System, stiffness: float) -> float:
    """That of the most damped object [N s/m]."""
    return max((_felt_damping(thing, stiffness) for thing in system.slave.scene), default=0.0)


# --- what the coding of positions and forces costs


def _positions(parts: DryRun, robot: Robot) -> Iterator[str]:
    """Errors of position that the robot turns into more force than may stay unsent."""
    codec, stiffness = parts.system.codec, robot.spec.stiffness_n_m
    if isinf(stiffness):
        return
    floor_n = codec.force.floor_n
    largest = max(codec.force.weber * parts.system.master.limits.force_n, floor_n)
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


def _angles(parts: DryRun, spec: "ArmSpec") -> Iterator[str]:
    """The coupling in the file, beside that of the follower."""
    for part, group, count in parts.system.codec.arm:
        own = spec.stiffness_nm_rad[:count] if part == "joints" else spec.stiffness_nm_rad[-count:]
        stated, bounds = group.angle.coupling_nm_rad, per_axis(group.angle.bound_rad, count)
        jump = max(map(truediv, map(mul, own, bounds), per_axis(group.torque.floor_nm, count)))
        field = f"codec.{part}.angle.coupling_nm_rad"
        if stated is None and jump > 1.0 and max(own) < inf:
            yield (
                f"{field}: not given, so an unsent error of an angle may change the torque by {jump:.2g} deadbands; "
                f"give that of {spec.name}, {max(own):.3g}"
            )
        elif stated is not None and (most := max(per_axis(stated, count))) < 0.5 * max(own) < inf:
            yield f"{field} {most:g}: {spec.name} is stiffer, {max(own):.3g} N m/rad; give that"


def _coding(parts: DryRun) -> Iterator[str]:
    if parts.is_of_arms:
        return
    force, position, device = parts.system.codec.force, parts.system.codec.position, parts.device
    if force.weber > PERCEPTUAL_WEBER_LIMIT:
        yield (
            f"codec.force.weber {force.weber:g}: published task performance falls above {PERCEPTUAL_WEBER_LIMIT:g}; "
            "use at most that"
        )
    if force.floor_n == 0.0:
        yield "codec.force.floor_n 0: sensor noise at rest is sent at every tick; use for example 0.02"
    if device is not None and force.trust.stiffness_n_m[1] > device.spec.stiffness_n_m:
        yield (
            f"codec.force.trust.stiffness_n_m: a fit may be stiffer than the {device.spec.stiffness_n_m:g} N/m of the "
            "device; use at most that"
        )
    for name, settings, least in (("force", force, force.floor_n), ("position", position, position.bound_m)):
        field = f"codec.{name}.lookahead_ms {settings.lookahead_ms:g}"
        if settings.lookahead_ms == 0.0:
            continue
        if settings.weber == least == 0.0:
            yield f"{field}: without a deadband every sample is sent, and each only later; use 0"
        elif not (settings.predictor in CHOICES or PREDICTORS[settings.predictor].looks_ahead):
            able = ", ".join(CHOICES)
            yield f"{field}: {settings.predictor} makes nothing of what it knows ahead; use {able}, or 0"


# --- delay


def _delay(parts: DryRun) -> Iterator[str]:
    """Limits that the emulated link or the tick exceeds; delays under the scheme that bounds no energy of a contact."""
    system = parts.system
    round_trip_ms = _emulated_ms(system) + 2e3 * system.tick_period
    if round_trip_ms > system.link.longest_round_trip_ms:
        yield (
            f"link.longest_round_trip_ms {system.link.longest_round_trip_ms:g}: the emulated round trip is up to "
            f"{round_trip_ms:g} ms, a tick of each side included, and gets no session; use at least {round_trip_ms:.0f}"
        )
    least_ms = SILENCE_TICKS * 1e3 * system.tick_period
    if system.link.silence_ms < least_ms:
        yield (
            f"link.silence_ms {system.link.silence_ms:g}: shorter than {SILENCE_TICKS} ticks at rate_hz "
            f"{system.rate_hz:g}: sessions would be interrupted; use at least {least_ms:.0f}"
        )
    if emulated := uncontrolled_delay(parts, 1e-3 * _emulated_ms(system)):
        yield emulated
    for line in added_delays(parts).values():
        yield f"{line}; use bounded"


def added_delays(parts: DryRun) -> dict[str, str]:
    """By their fields, delays of the file that its control scheme does not control, and what is to be said of them."""
    if parts.system.control.scheme != "none":
        return {}
    delays = {field: ms for field, ms in parts.system.delays_ms.items() if ms > 0.0}
    why = "control.scheme none leaves this delay uncontrolled, and a contact may oscillate"
    return {field: f"{field} {ms:g}: {why}" for field, ms in delays.items()}


def uncontrolled_delay(parts: DryRun, round_trip: float) -> str | None:
    """What to say of a round trip [s] under `control.scheme: none`; None if that bears it, or another scheme is set."""
    system, borne = parts.system, borne_round_trip(parts)
    if system.control.scheme != "none" or round_trip <= borne * ROUNDING:
        return None
    return (
        f"control.scheme none: a contact may gain energy at a round trip of {1e3 * round_trip:.3g} ms; here it bears "
        f"{_at_most(1e3 * borne)} ms; use bounded"
    )


def on_measured_delay(parts: DryRun) -> Callable[[float], str | None]:
    """What is to be said of a measured round trip [s]: nothing, if that was said of the emulated one."""
    if uncontrolled_delay(parts, 1e-3 * _emulated_ms(parts.system)) is not None:
        return lambda _: None
    return partial(uncontrolled_delay, parts)


def borne_round_trip(parts: DryRun) -> float:
    """The longest round trip at which a contact gains no energy without control [s].

    With damping b of device and hand, and stiffness K and damping B of the stiffest contact as it is felt, that is
    (b - B) / K - T / 2 - T, the bound of `passivity_limit`. Where b or K is not known, it is `UNKNOWN_BORNE`."""
    system, damping = parts.system, _device_damping(parts.configuration)
    coupling = inf if parts.robot is None else parts.robot.spec.stiffness_n_m
    felt = max((min(thing.stiffness_n_m, coupling) for thing in system.slave.scene), default=coupling)
    if damping is None or isinf(felt):
        return UNKNOWN_BORNE
    return max(0.0, (damping - _wall_damping(system, coupling)) / felt - (0.5 + LOOP_TICKS) * system.tick_period)


def _emulated_ms(system: System) -> float:
    """Longest round trip that the file emulates [ms]."""
    return sum(way.delay_ms + way.jitter_ms for way in (system.link.emulate or EmulationSettings()).directions)


# --- addresses


def placeholders(parts: DryRun) -> Iterator[str]:
    """Addresses that stand for one's own: of the slave, which the operator's side calls, or of a device or robot."""
    configuration, link = parts.configuration, parts.system.link
    found = {} if configuration.finds_path or configuration.device is None else {"link.slave": link.slave}
    for where, part in (("master.device", configuration.device), ("slave.robot", configuration.robot)):
        options = {} if part is None else part.options.model_dump()
        found |= {f"{where}.{name}": value for name, value in options.items() if isinstance(value, str)}
    for field, text in found.items():
        if is_placeholder(_host_in(text)):
            whose = "on the operator's host set it to that of the robot" if field == "link.slave" else "set it to yours"
            yield f"{field} {text}: {PLACEHOLDER}; {whose}"


def _host_in(text: str) -> str:
    """The host of an address, with or without port, or of a URL; of another text, anything."""
    try:
        return urlsplit(text if "://" in text else f"//{text}").hostname or ""
    except ValueError:
        return ""


# --- the machine


def tick_rate(parts: DryRun, tick_s: Callable[[Configuration], float | None] | None = None) -> Iterator[str]:
    """A tick rate that this machine can hardly hold; a usual one is not looked at. `tick_s` measures how long a tick
    takes [s], or None where it cannot."""
    system = parts.system
    took = None if system.rate_hz <= USUAL_RATE_HZ else (tick_s or measured_tick_s)(parts.configuration)
    if took is not None and took > TICK_SHARE * system.tick_period:
        most = max(100.0, 100.0 * floor(TICK_SHARE / took / 100.0))
        yield (
            f"rate_hz {system.rate_hz:g}: a tick takes about {1e6 * took:.0f} of its {1e6 * system.tick_period:.0f} us "
            f"on this machine, and many would be missed; use at most {most:g}"
        )


def measured_tick_s(configuration: Configuration) -> float | None:
    """Median run time of a tick of both sides in virtual time [s], which is about that of one side in real time.

    A simulated hand and a point stand in for what cannot run in virtual time; None where they do not fit the file."""
    from weberlink.session.simulation import build_simulation  # noqa: PLC0415 - for unusual rates alone

    system = configuration.system
    link = system.link.model_copy(update={"emulate": None})  # a session begins at once
    codec = system.codec.model_copy(update={"rotation": None, "joints": None, "gripper": None})
    here = system.model_copy(update={"link": link})
    plain = here.model_copy(update={"codec": codec, "master": MasterSettings(), "slave": SlaveSettings()})
    hand, point = (Part(driver, driver.Options()) for driver in (DEVICES["operator"], ROBOTS["point"]))
    for candidate in (
        replace(configuration, system=here),
        replace(configuration, system=plain, device=hand, robot=point),
    ):
        try:
            simulation = build_simulation(candidate)
        except ConfigurationError:
            continue
        with closing(simulation):
            return median(repeat(simulation.step, number=1, repeat=TICKS))
    return None


def _polling(parts: DryRun) -> Iterator[str]:
    system = parts.system
    sides, cpus = 2 if is_loopback(split_address(system.link.slave)[0]) else 1, len(os.sched_getaffinity(0))
    if system.realtime.busy_poll and cpus <= sides:
        yield (
            f"realtime.busy_poll: each daemon takes a processor, and this machine has {cpus} for {sides} of them and "
            "everything else; use false, or a machine with more processors"
        )


RULES: tuple[tuple[Any, ...], ...] = (
    (_device, "device"), (_robot, "robot"), (_arms,), (_limits, "device"), (_contact, "device", "robot"),
    (_positions, "robot"), (_angles, "follower"), (_coding,), (_delay,), (placeholders,), (tick_rate,), (_polling,),
)  # fmt: skip
"""Each rule with the parts of a `DryRun` that it needs: it is asked where all of them are there."""


def _at_most(value: float) -> str:
    """A largest value in two digits, rounded down, so that a file that follows the advice keeps the bound."""
    if value <= 0.0:
        return "0"
    digit = floor(log10(value)) - 1
    return f"{floor(value * 10.0**-digit * ROUNDING) * 10.0**digit:g}"
