"""The coupling: how stiff the robot is towards its command, and how hard it may press.

A sampled wall of stiffness K and damping B is passive on a device of damping b if b > K T / 2 + B, with the tick period
T (Colgate, Schenkel, "Passivity of a class of sampled-data systems", ACC 1994). So each device has a stiffest wall that
it can display, and a robot that is stiffer than this towards its command cannot be felt as it is: its wall is displayed
softer, or the loop becomes active. With the robot's stiffness within that of the device, every wall can be displayed
as the robot feels it.
"""

from weberlink.master.devices.contract import Device
from weberlink.slave.robots.contract import Robot
from weberlink.system.composition.link import construct
from weberlink.system.configuration import Configuration, ConfigurationError, System
from weberlink.system.configuration.loading import load_device

FIT_MARGIN = 1.2
"""Stiffness of the device over that of the robot. A fit of the contact may err by so much and is still displayed."""
STATED = "stiffness_n_m"
"""Option of a robot driver that states its stiffness towards the command [N/m]."""


def coupling(configuration: Configuration) -> float:
    """Stiffness of the robot towards its command [N/m]: as the file states it, or by the device.

    Raises:
        ConfigurationError: the file does not state it, and the device cannot be built on this host.
    """
    system = configuration.system
    stated = system.slave.robot.options.get(STATED)
    if isinstance(stated, int | float) and stated > 0.0:
        return float(stated)
    try:
        part = load_device(configuration)
        device: Device = construct("master.device", part.driver, part.options, system.tick_period)
    except (ConfigurationError, OSError) as error:
        raise ConfigurationError(
            f"slave.robot.{STATED}: follows the device by default, which cannot be built on this host ({error}); "
            "set it to the stiffest wall that the device displays [N/m]"
        ) from None
    mapping = system.master.mapping
    scale = 1.0 if mapping is None else mapping.scale * mapping.force_scale
    return device.spec.stiffness_n_m / (FIT_MARGIN * scale)


def press_limit(system: System, robot: Robot) -> float:
    """Largest force with which the robot presses [N]: as the file states it, or what the operator can feel of it."""
    limit, mapping = system.slave.limits.contact_n, system.master.mapping
    if limit is not None:
        return limit
    felt = system.master.limits.force_n / (1.0 if mapping is None else mapping.force_scale)
    return min(felt, robot.spec.force_n)
