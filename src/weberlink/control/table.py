"""The registry of control schemes, built in and of installed distributions.

To add one, write a file in this folder and a line in `BUILT_IN`; or, in another distribution, an entry point of the
group `weberlink.control_schemes` that names a `Scheme`.
"""

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from weberlink.control.contract import MasterControl, SchemeParameters, SlaveControl
from weberlink.registry import Registry, import_part


class Scheme(NamedTuple):
    """A control scheme; its classes are imported on use."""

    master: str  # "module:Class" of the operator's end, a `weberlink.control.contract.MasterControl`
    slave: str  # likewise of the teleoperator's end, a `SlaveControl`
    carries_credit: bool  # whether datagrams carry energy credit
    does: str  # in one line
    reads_position: bool = True  # the operator's end reads where each force was measured: every update carries it


BUILT_IN = {
    "none": Scheme(
        "weberlink.control.contract:MasterControl",
        "weberlink.control.contract:SlaveControl",
        carries_credit=False,
        does="what is decoded is displayed and followed",
        reads_position=False,
    ),
    "bounded": Scheme(
        "weberlink.control.bounded:BoundedMaster",
        "weberlink.control.bounded:BoundedSlave",
        carries_credit=True,
        does="what is known of the contact is felt, within an account of energy",
    ),
}


def _check(name: str, entry: Any) -> None:
    if not isinstance(entry, Scheme):
        raise ValueError(f"control scheme {name}: its entry point is not a weberlink.control.table.Scheme")  # noqa: TRY004 - the file is wrong


SCHEMES: Registry[Scheme] = Registry("control scheme", BUILT_IN, "weberlink.control_schemes", _check)
"""By name."""
if TYPE_CHECKING:
    SchemeName = str
else:
    SchemeName = Literal[tuple(SCHEMES)]
    """Values of `control.scheme` in a configuration."""


def build_master_control(name: str, settings: SchemeParameters) -> MasterControl:
    """The operator's end of a scheme; raises ValueError if the scheme of another distribution is broken."""
    return ends_of(name)[0](settings)


def build_slave_control(name: str, settings: SchemeParameters) -> SlaveControl:
    """The teleoperator's end of a scheme; raises ValueError if the scheme of another distribution is broken."""
    return ends_of(name)[1](settings)


def ends_of(name: str) -> tuple[type[MasterControl], type[SlaveControl]]:
    """The classes of both ends.

    Raises:
        ValueError: the scheme of another distribution cannot be imported, or a class does not inherit from its end.
    """
    scheme, what = SCHEMES[name], f"control scheme {SCHEMES.owned(name)}"
    master, slave = import_part(what, scheme.master), import_part(what, scheme.slave)
    for place, made, end in ((scheme.master, master, MasterControl), (scheme.slave, slave, SlaveControl)):
        if not (isinstance(made, type) and issubclass(made, end)):
            raise ValueError(f"{what}: {place} does not inherit from {end.__module__}.{end.__qualname__}")  # noqa: TRY004 - wrong name
    return master, slave
