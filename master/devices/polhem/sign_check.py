"""The settings of these devices that a sign check is good for; pure."""

from weberlink.master.devices import sign_check
from weberlink.master.devices.polhem.parameters import Parameters


def fingerprint(driver: str, parameters: Parameters) -> str:
    """It changes with the driver, the set, the signs of encoders and motors, and the home counts."""
    drive = parameters.mechanism.drive
    signs = f"encoders {drive.encoder_directions} motors {drive.motor_directions}"
    return sign_check.fingerprint(f"{driver} {parameters.name} {signs} {drive.home_counts}")
