"""Builds the teleoperator's end with robot and scene, from a configuration."""

from collections.abc import Callable
from typing import Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.config import Configuration, ConfigurationError, System
from weberlink.control.contract import LEAST_CONTACT
from weberlink.control.table import build_slave_control
from weberlink.protocol.endpoint import Endpoint
from weberlink.session.channels import IncomingChannel
from weberlink.session.composition.channels import check_span, least_contact, streams
from weberlink.session.composition.coupling import STATED, coupling, press_limit
from weberlink.session.composition.link import (
    build_control,
    build_driver,
    build_tuning,
    check_axes,
)
from weberlink.session.side import Parts
from weberlink.slave.guard import Guard, PressLimit, Workspace
from weberlink.slave.robot_port import ContactForce, RobotPort, Unreached
from weberlink.slave.robots.contract import Robot
from weberlink.slave.scenes.settings import build

DAMPING_MOST = 100.0  # largest damping of a surface that the press limit provides for [N s/m]. Chosen.


def build_led(configuration: Configuration, endpoint: Endpoint, stopwatch: Callable[[], float] | None) -> Parts:
    """The port of a robot that a hand leads, its channels out and in, and the settings that may change; `stopwatch` as
    of `Context`."""
    system, robot = configuration.system, build_robot(configuration)
    if stopwatch is not None and hasattr(robot, "publish_pose"):
        robot.publish_pose()
    if stopwatch is not None and hasattr(robot, "measure_steps"):
        robot.measure_steps(stopwatch)
    forward, backward = streams(system)
    limits, spec, rotation = system.slave.limits, robot.spec, system.codec.rotation
    ramp = limits.ramp_ms * 1e-3
    tool: Any = None
    if rotation is not None:
        from weberlink.slave.rotation import ToolOrientation, ToolTorque  # noqa: PLC0415 - for six degrees of freedom

        tool = ToolOrientation(speed=limits.turn_rad_s, approach_speed=limits.approach_turn_rad_s, ramp=ramp)
    force = ContactForce(Encoder(backward[0]), spec.stiffness_n_m)
    press = PressLimit(press_limit(system, robot), spec.stiffness_n_m, damping=DAMPING_MOST, contact=LEAST_CONTACT)
    port = RobotPort(
        robot,
        guard=Guard(
            [press],
            workspace=workspace_of(system, robot),
            trips=(spec.force_n if limits.trip_n is None else limits.trip_n,),
            speed=limits.speed_m_s,
            approach_speed=limits.approach_speed_m_s,
            ramp=ramp,
            trip_retract=limits.retract_m,
            retract=limits.retract_m if limits.on_silence == "retract" else 0.0,
        ),
        sensors=[force],
        endpoint=endpoint,
        control=build_control(system, build_slave_control, spec.stiffness_n_m),
        tool=tool,
        by_button=system.master.engage is not None,
    )

    force.unreached = Unreached(force.encoder.mirror, port, 0, least_contact(system), system.tick_period)
    outgoing: list[OutgoingChannel] = [force]
    incoming = [IncomingChannel(Decoder(channel)) for channel in forward]
    if rotation is not None:
        encoder = Encoder(backward[1])
        unreached = Unreached(encoder.mirror, port, 1, rotation.torque.floor_nm, system.tick_period)
        outgoing.append(ToolTorque(encoder, port.shown, tool, unreached))
    return Parts(port, outgoing, incoming, build_tuning(system, force.encoder))


def build_robot(configuration: Configuration) -> Robot:
    """The robot with the scene that it touches, not yet open; raises ConfigurationError if either cannot be made of its
    options, the wire cannot say its forces, or a limit of the file is beyond its range."""
    system, part = configuration.system, configuration.robot
    assert part is not None
    options = part.options
    if getattr(options, STATED, 0.0) is None:
        options = options.model_copy(update={STATED: coupling(configuration)})
    try:
        scene = build(system.slave.scene) if system.slave.scene else None
    except ValueError as error:
        raise ConfigurationError(f"slave.scene: {error}") from None
    robot: Robot = build_driver("slave.robot", part.driver, options, scene, system.tick_period, contract=Robot)
    check_axes("slave.robot", robot.spec.axes, system)
    force, *torque = streams(system)[1]
    check_span("codec.force.step_n", force, "slave.robot reports up to", robot.spec.force_n, "N")
    press_limit(system, robot)
    for channel in torque:
        if not (hasattr(robot, "point") and robot.spec.torque_n_m > 0.0):
            raise ConfigurationError(
                f"codec.rotation: slave.robot driver {system.slave.robot.driver}, as it is set here, takes no "
                "orientation; use one that does, or leave codec.rotation out"
            )
        most = robot.spec.torque_n_m
        check_span("codec.rotation.torque.step_nm", channel, "slave.robot reports up to", most, "N m")
    return robot


def workspace_of(system: System, robot: Robot) -> Workspace:
    """Where the robot may be commanded to: its own workspace within that of the file."""
    allowed = system.slave.limits.workspace_m
    spans = [
        (max(low, robot_low), min(high, robot_high))
        for (low, high), robot_low, robot_high in zip(allowed, *robot.spec.workspace_m, strict=True)
    ]
    if not all(low < high for low, high in spans):
        raise ConfigurationError("slave.limits.workspace_m: leaves nothing of the robot's own workspace")
    (x0, x1), (y0, y1), (z0, z1) = spans
    return (x0, y0, z0), (x1, y1, z1)
