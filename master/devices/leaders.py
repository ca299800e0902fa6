"""The table of leader arms, extended by entry points of the group `weberlink.leaders`."""

from weberlink.registry import Driver, Registry

BUILT_IN = {
    "remote_leader": "weberlink.master.devices.remote_leader:RemoteLeader",
}
LEADERS: Registry[Driver] = Registry("leader arm", BUILT_IN, "weberlink.leaders")
