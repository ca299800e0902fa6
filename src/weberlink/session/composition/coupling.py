"""The coupling: how stiff the robot is towards its command, and how hard it may press.

A sampled wall is passive on a damped device up to a stiffness only (`weberlink.control.account`). So each device has
a stiffest wall that it can display, and a robot that is stiffer than this towards its command cannot be felt as it is:
its wall is displayed softer, or the loop becomes active. With the robot's stiffness within that of the device, every
wall can be displayed as the robot feels it.
"""

from weberlink.config import Configuration, ConfigurationError, System
from weberlink.config.loading import load_device
from weberlink.control.contract import LEAST_CONTACT
from weberlink.master.devices.contract import Device
from weberlink.session.composition.link import build_driver
from weberlink.slave.robots.contract import Robot
from weberlink.slave.robots.virtual import STIFFEST, UNSTATED

FIT_MARGIN = 1.2
"""Stiffness of the device over that of the robot. A fit of the contact may err by so much and is still displayed."""
STATED = "stiffness_n_m"  # option of a robot driver that states its stiffness towards the command [N/m]


def coupling(configuration: Configuration, device: Device | None = None) -> float:
    """Stiffness of the robot towards its command [N/m]: as the file states it, or by the device, given in the robot's
    frame where it is built already; raises ConfigurationError if it cannot be built on this host."""
    system = configuration.system
    stated = system.slave.robot.options.get(STATED)
    if isinstance(stated, int | float) and stated > 0.0:
        return float(stated)
    scale = 1.0
    if device is None:
        scale = system.master.frame_map.scale * system.master.frame_map.force_scale
        try:
            part = load_device(configuration)
            device = build_driver("master.device", part.driver, part.options, system.tick_period)
        except (ConfigurationError, OSError) as error:
            raise ConfigurationError(
                f"slave.robot.{STATED}: follows the device by default, which cannot be built on this host ({error}); "
                "set it to the stiffest wall that the device displays [N/m]"
            ) from None
    displayed = device.spec.stiffness_n_m / scale
    if displayed <= 0.0:  # of a device without force
        return UNSTATED
    return min(displayed / FIT_MARGIN, STIFFEST)


def press_limit(system: System, robot: Robot) -> float:
    """Largest force with which the robot presses [N]: as the file states it, or what the operator can feel of it;
    raises ConfigurationError if the robot cannot measure it, or it is less than a contact."""
    limit, most = system.slave.limits.contact_n, robot.spec.force_n
    if limit is not None:
        if limit > most:
            raise ConfigurationError(
                f"slave.limits.contact_n {limit:g}: {robot.spec.name} measures at most {most:g} N; use at most {most:g}"
            )
        return limit
    felt = system.master.limits.force_n / system.master.frame_map.force_scale
    if felt < LEAST_CONTACT:
        raise ConfigurationError(
            f"master.limits.force_n: leaves {felt:g} N at the robot, less than a contact ({LEAST_CONTACT:g} N); use a "
            "higher force_n or a lower master.mapping.force_scale"
        )
    return min(felt, most)
