"""The registry of control schemes: those built in, and those of installed distributions.

A new scheme is a file beside these and a line in `BUILT_IN`, or an entry point of the group `weberlink.control_schemes`
in another distribution, which names a `Scheme`.
"""

from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

from weberlink.control.contract import Control, MasterControl, SchemeParameters, SlaveControl

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


class Registry(Mapping[str, Scheme]):
    """Schemes by name, the built-in ones first; what another distribution brings is imported on use.

    The place of a scheme in this order is its code in a telemetry record. A built-in name cannot be replaced.
    """

    def __init__(self) -> None:
        self._entries: dict[str, Scheme | EntryPoint] = dict(BUILT_IN)
        for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
            self._entries.setdefault(entry.name, entry)

    def __getitem__(self, name: str) -> Scheme:
        entry = self._entries[name]
        if isinstance(entry, Scheme):
            return entry
        try:
            scheme = entry.load()
        except Exception as error:
            raise ValueError(f"control scheme {name} cannot be imported from {entry.value}: {error}") from error
        if not isinstance(scheme, Scheme):
            raise ValueError(f"control scheme {name}: {entry.value} is not a weberlink.control.table.Scheme")  # noqa: TRY004 - the file is wrong
        self._entries[name] = scheme
        return scheme

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


SCHEMES: Mapping[str, Scheme] = Registry()
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
