"""What a sign check is good for: the settings that it was made with, in eight digits; pure."""

from hashlib import sha256


def fingerprint(settings: str) -> str:
    """Eight hexadecimal digits of settings, put in words by a driver.

    The first is a letter, so that a YAML file takes it for a text and not for a number.
    """
    digest = sha256(settings.encode()).digest()
    return f"{digest[0] | 0xA0:02x}{digest[1:4].hex()}"
