"""The table of leader arms, all of them entry points of the group `weberlink.leaders`."""

from weberlink.registry import Driver, Registry

LEADERS: Registry[Driver] = Registry("leader arm", {}, "weberlink.leaders")
