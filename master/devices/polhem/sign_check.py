"""The settings of these devices that a sign check is good for; pure."""

from master.devices import sign_check
from master.devices.polhem.parameters import Parameters


def fingerprint(driver: str, parameters: Parameters) -> str:
    """It changes with the driver, the set of parameters, its directions and home counts."""
    drive = parameters.mechanism.drive
    return sign_check.fingerprint(f"{driver} {parameters.name} {drive.directions} {drive.home_counts}")
