"""The registry of control schemes: those built in, and those of installed distributions.

A new scheme is a file beside these and a line in `BUILT_IN`, or an entry point of the group `weberlink.control_schemes`
in another distribution, which names a `Scheme`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

from weberlink.control.contract import Control, MasterControl, SchemeParameters, SlaveControl
from weberlink.registry import Registry

GROUP = "weberlink.control_schemes"


class Scheme(NamedTuple):
    """A control scheme.

    Args:
        master: "module:Class" of the operator's end, a `MasterControl` built from `SchemeParameters`; imported on use.
        slave: likewise of the teleoperator's end, a `SlaveControl`.
        carries_credit: whether datagrams carry energy.
        does: one line for people.
    """

    master: str
    slave: str
    carries_credit: bool
    does: str


BUILT_IN = {
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


def _check(name: str, entry: Any) -> None:
    if not isinstance(entry, Scheme):
        raise ValueError(f"control scheme {name}: its entry point is not a weberlink.control.table.Scheme")  # noqa: TRY004 - the file is wrong


SCHEMES: Registry[Scheme] = Registry("control scheme", BUILT_IN, GROUP, _check)
"""By name; the place of a scheme in this order is its code in a telemetry record."""
if TYPE_CHECKING:
    SchemeName = str
else:
    SchemeName = Literal[tuple(SCHEMES)]
    """What `control.scheme` of a configuration may say."""


def build_master_control(name: str, settings: SchemeParameters) -> MasterControl:
    """The operator's end of a scheme; raises ValueError where an installed one is broken."""
    return cast(MasterControl, _build(name, SCHEMES[name].master, settings))


def build_slave_control(name: str, settings: SchemeParameters) -> SlaveControl:
    """The teleoperator's end of a scheme; raises ValueError where an installed one is broken."""
    return cast(SlaveControl, _build(name, SCHEMES[name].slave, settings))


def _build(name: str, place: str, settings: SchemeParameters) -> Control:
    module, _, attribute = place.partition(":")
    control: Any = getattr(import_module(module), attribute)(settings)
    if control.active not in SCHEMES:
        raise ValueError(f"control scheme {name}: {place} says that {control.active!r} is active, which is no scheme")
    return cast(Control, control)
