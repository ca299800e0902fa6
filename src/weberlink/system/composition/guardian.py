"""Whether the force of a device ends when this host stops."""

from weberlink.master.devices.contract import Device, GuardedDevice
from weberlink.system.configuration import ConfigurationError


def check_force_ends(device: Device, driver: str, accepted: str | None) -> None:
    """See that the board of a device removes the force by itself, or that a guardian process does.

    Args:
        device: not wrapped by a mapping.
        driver: its name.
        accepted: `master.accept_no_watchdog`, the driver that may do without either.

    Raises:
        ConfigurationError: the device has force and neither of the two, and the file does not accept that.
    """
    spec = device.spec
    ends = spec.watchdog_s is not None or (isinstance(device, GuardedDevice) and device.guarded)
    if spec.force_feedback and not ends and accepted != driver:
        raise ConfigurationError(
            f"master.device: if this host stops, {driver} keeps its last force: its driver states no watchdog and has "
            f"no guardian (see docs/tutorial.md); to accept that, set master.accept_no_watchdog: {driver}"
        )
