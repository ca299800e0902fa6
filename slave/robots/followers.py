"""The table of follower arms, all of them entry points of the group `weberlink.followers`."""

from weberlink.registry import Driver, Registry

FOLLOWERS: Registry[Driver] = Registry("follower arm", {}, "weberlink.followers")
