"""The table of follower arms, extended by entry points of the group `weberlink.followers`."""

from weberlink.arms.contract import ArmDriver
from weberlink.registry import Registry

BUILT_IN: dict[str, str] = {}
FOLLOWERS: Registry[ArmDriver] = Registry("follower arm", BUILT_IN, "weberlink.followers")
