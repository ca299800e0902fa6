"""The table of control schemes. A new one is a file beside these and a line here."""

from importlib import import_module
from typing import NamedTuple, cast

from weberlink.control.contract import MasterControl, Settings, SlaveControl


class Scheme(NamedTuple):
    """Where a scheme's two sides are ("module:Class", imported only on use), whether energy travels, what it does."""

    master: str
    slave: str
    carries_credit: bool
    does: str


SCHEMES = {
    "none": Scheme(
        "weberlink.control.direct:DirectMaster",
        "weberlink.control.direct:DirectSlave",
        carries_credit=False,
        does="what is decoded is displayed and followed",
    ),
    "tdpa": Scheme(
        "weberlink.control.tdpa:TdpaMaster",
        "weberlink.control.tdpa:TdpaSlave",
        carries_credit=True,
        does="energy tanks and passivity controllers at both ports",
    ),
    "mmt": Scheme(
        "weberlink.control.mmt:MmtMaster",
        "weberlink.control.direct:DirectSlave",
        carries_credit=False,
        does="the operator feels the fitted plane or sphere at once",
    ),
    "auto": Scheme(
        "weberlink.control.auto:AutoMaster",
        "weberlink.control.auto:AutoSlave",
        carries_credit=True,
        does="none, tdpa or mmt, by the measured delay",
    ),
}
"""By name; `active` of a side is the place in this order."""


def build_master_control(name: str, settings: Settings) -> MasterControl:
    """The operator's side of a scheme; only that one is imported."""
    return cast(MasterControl, _load(SCHEMES[name].master)(settings))


def build_slave_control(name: str, settings: Settings) -> SlaveControl:
    """The teleoperator's side of a scheme; only that one is imported."""
    return cast(SlaveControl, _load(SCHEMES[name].slave)(settings))


def _load(place: str) -> type:
    module, _, attribute = place.partition(":")
    return cast(type, getattr(import_module(module), attribute))
