"""The table of follower arms, extended by entry points of the group `weberlink.followers`."""

from weberlink.registry import Driver, Registry

BUILT_IN: dict[str, str] = {}
FOLLOWERS: Registry[Driver] = Registry("follower arm", BUILT_IN, "weberlink.followers")
