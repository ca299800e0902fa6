"""The table of leader arms, extended by entry points of the group `weberlink.leaders`."""

from weberlink.arms.contract import ArmDriver
from weberlink.registry import Registry

BUILT_IN = {
    "remote_leader": "weberlink.master.devices.remote_leader:RemoteLeader",
}
LEADERS: Registry[ArmDriver] = Registry("leader arm", BUILT_IN, "weberlink.leaders")
