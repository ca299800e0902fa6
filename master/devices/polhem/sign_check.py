"""What a sign check is good for: the settings it was made with, in eight digits; pure."""

from hashlib import sha256

from master.devices.polhem.parameters import Parameters


def fingerprint(driver: str, parameters: Parameters) -> str:
    """Eight hexadecimal digits that change with the driver, the set of parameters, its directions and home counts.

    The first is a letter, so that a YAML file takes it for a text and not for a number.
    """
    drive = parameters.mechanism.drive
    said = f"{driver} {parameters.name} {drive.directions} {drive.home_counts}"
    digest = sha256(said.encode()).digest()
    return f"{digest[0] | 0xA0:02x}{digest[1:4].hex()}"
