"""The table of follower arms, extended by entry points of the group `weberlink.followers`."""

from weberlink.arms.contract import ArmDriver
from weberlink.registry import Registry

BUILT_IN: dict[str, str] = {}
FOLLOWERS: Registry[ArmDriver] = Registry("follower arm", BUILT_IN, "weberlink.followers")

drivers = FOLLOWERS.places


def load(name: str) -> ArmDriver:
    """The driver class; raises ValueError for an unknown name, ImportError where its package is missing."""
    try:
        return FOLLOWERS.load(name)
    except ValueError as error:
        raise ValueError(f"driver: {error}") from None
