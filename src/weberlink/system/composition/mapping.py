"""The map between device and robot that a configuration asks for; imports nothing of it where there is none."""

from weberlink.master.devices.contract import Device
from weberlink.system.configuration import ConfigurationError, System


def build_mapping(system: System, device: Device) -> Device:
    """The device in the robot's frame.

    Raises:
        ConfigurationError: if the device has no such button.
    """
    from weberlink.master.mapping import Clutch, FrameMap, MappedDevice, Walls  # noqa: PLC0415

    mapping, limits = system.master.mapping, system.master.limits
    assert mapping is not None
    clutch = walls = None
    if mapping.clutch is not None:
        button = mapping.clutch.button
        if button >= device.spec.buttons:
            raise ConfigurationError(
                f"master.mapping.clutch.button: {device.spec.name} has {device.spec.buttons} buttons, none is {button}"
            )
        clutch = Clutch(button)
    if mapping.walls is not None:
        (x0, x1), (y0, y1), (z0, z1) = mapping.walls.box_m or system.slave.limits.workspace_m
        walls = Walls(((x0, y0, z0), (x1, y1, z1)), mapping.walls.stiffness_n_m)
    return MappedDevice(
        device,
        FrameMap(mapping.rotation_deg, mapping.scale, mapping.force_scale, mapping.offset_m),
        clutch=clutch,
        walls=walls,
        force_limit=limits.force_n,
        ramp=limits.ramp_ms * 1e-3,
    )
