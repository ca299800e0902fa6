"""Tables of implementations by name, imported on first use and extended by entry points of other distributions."""

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import reduce
from importlib import import_module
from itertools import product
from pathlib import Path
from traceback import walk_tb
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, NamedTuple, Protocol, TypeVar

from weberlink.installation import absence, entries, guests

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from types import FrameType

    from pydantic import BaseModel  # else a process that only serves a device would take a second to start

T = TypeVar("T")


Tier = Literal["met hardware", "judged by others", "emulated only"]
"""What a driver of hardware was tried on: the hardware, software of others that stands for it or judges what stands for
it, or an emulator of its own makers alone."""


def is_hardware(driver: object) -> bool:
    """Whether a driver may move something real: every one may that does not say `COMPUTED = True`."""
    return not getattr(driver, "COMPUTED", False)


class Driver(Protocol):
    """A driver class: its options, and a device, robot or arm made of them and the tick period [s].

    A robot is made of its options, the scene that a simulated one touches (None for a real one), and the tick period.
    """

    Options: "ClassVar[type[BaseModel]]"
    __call__: Callable[..., Any]


class PartError(ValueError):
    """A part of another distribution cannot be imported; the text is one line, the cause what it raised."""


class Registry(Mapping[str, T], Generic[T]):
    """Maps names to objects; a built-in name wins over an entry point of the same name.

    Installed distributions are searched only for a name that is not built in, or to list all names, because the search
    reads the metadata of every distribution. Names are listed in the order of `built_in`, then alphabetically.

    Args:
        kind: what an entry is, for error messages, such as "robot".
        built_in: each built-in object, or its place ("module:attribute").
        group: group of entry points that extends the table; None for a closed table.
        check: called with the name and object of an entry point; raises ValueError if the object cannot be used.
    """

    def __init__(
        self,
        kind: str,
        built_in: Mapping[str, T | str],
        group: str | None = None,
        check: Callable[[str, Any], None] = lambda _name, _entry: None,
    ) -> None:
        self.kind = kind
        self.built_in = built_in
        self.group = group
        self._check = check
        self._loaded: dict[str, T] = {}
        _TABLES.append(self)

    def __getitem__(self, name: str) -> T:
        """Import an entry.

        Raises:
            KeyError: no entry has this name.
            ImportError: a package that a built-in entry needs is missing.
            PartError: the entry of another distribution cannot be imported.
            ValueError: it cannot be used.
        """
        if name not in self._loaded:
            if name in self.built_in:
                entry: Any = self.built_in[name]
                entry = resolve(entry) if isinstance(entry, str) else entry
            else:
                installed = self._installed[name]
                entry = import_part(f"{self.kind} {self.owned(name)}", f"{installed.module}:{installed.attr}")
                self._check(name, entry)
            self._loaded[name] = entry
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.built_in, *sorted(self._installed.keys() - self.built_in.keys())))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in self.built_in or name in self._installed

    def load(self, name: str) -> T:
        """Import an entry; raises as `self[name]`, but ValueError with the nearest name for an unknown one."""
        return self[self.check_known(name)]

    def check_known(self, name: str) -> str:
        """Return the name if an entry has it; raises ValueError if no entry has this name; the message says how to
        install the guest that has it, or lists all names and the nearest one."""
        if name in self:
            return name
        absent = self.absent()
        if name in absent:
            raise ValueError(absence(f"{self.kind} {name!r}", absent[name]))
        names = [*self, *absent]
        (nearest,) = get_close_matches(name, names, n=1, cutoff=0.0)
        raise ValueError(f"no {self.kind} is called {name!r}; nearest is {nearest!r}, there are {', '.join(names)}")

    def absent(self) -> dict[str, str]:
        """Names of entries that guests of this project add and that are not installed here, each with its guest."""
        return {name: guest for name, guest in guests(self.group).items() if name not in self}

    def distribution(self, name: str) -> str | None:
        """The distribution that has an entry; None for one that is built in."""
        installed = None if name in self.built_in else self._installed.get(name)
        return None if installed is None or installed.dist is None else installed.dist.name

    def owned(self, name: str) -> str:
        """The name of an entry, with the distribution that has it where that is another one."""
        owner = self.distribution(name)
        return name if owner is None else f"{name} of {owner}"

    def runs(self, frame: "FrameType") -> str | None:
        """The name of the loaded entry whose method a frame runs, the most derived one; None for another frame."""
        part = frame.f_locals.get("self")
        owners = () if part is None else (part, *type(part).__mro__)
        return next((name for owner in owners for name, entry in self._loaded.items() if entry is owner), None)

    def ships(self, frame: "FrameType") -> str | None:
        """The name of a loaded entry of another distribution in whose module, or package, a frame runs; else None."""
        module = frame.f_globals.get("__name__", "")
        for name in self._loaded.keys() & (self._installed.keys() - self.built_in.keys()):
            package, _, own = self._installed[name].module.rpartition(".")
            if module.startswith(f"{package}.") if package else module == own:
                return name
        return None

    @property
    def _installed(self) -> Mapping[str, "EntryPoint"]:
        return entries(self.group)


_TABLES: list[Registry[Any]] = []  # all of this process


def resolve(place: str) -> Any:
    """Import "module:attribute"; the attribute may have dots. ImportError or AttributeError if something is missing."""
    module, _, attribute = place.partition(":")
    return reduce(getattr, filter(None, attribute.split(".")), import_module(module))


def import_part(what: str, place: str) -> Any:
    """Import "module:attribute" of another distribution, whose module may raise anything; PartError if it cannot be
    imported. `what` is its kind, name and distribution, for the message."""
    try:
        return resolve(place)
    except Exception as error:
        raise PartError(f"{what}: {place} cannot be imported: {in_words(error)}") from error


def in_words(error: BaseException) -> str:
    """Type and text of an error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


class PartFault(NamedTuple):
    """An error that escaped from a part by name: kind, name, distribution, error and line; and whether the part is of
    another distribution, or else the error one of this program."""

    text: str
    is_foreign: bool


def fault_of(error: BaseException) -> PartFault | None:
    """The part by name, such as a driver, from which an error escaped; None for an error of other code.

    A method of a part is looked for first, from the innermost frame outwards, then other code that comes with a part of
    another distribution.
    """
    frames = list(walk_tb(error.__traceback__))[::-1]
    for look in (Registry.runs, Registry.ships):
        for (frame, _), table in product(frames, _TABLES):
            if (name := look(table, frame)) is not None:
                file = frame.f_code.co_filename
                line = next(number for each, number in frames if each.f_code.co_filename == file)
                text = f"{table.kind} fault: {table.owned(name)}: {in_words(error)} ({Path(file).name}:{line})"
                return PartFault(text, name not in table.built_in)
    return None


def check_contract(what: str, made: object, contract: type) -> None:
    """See that an object, or a class, has all that a protocol names; ValueError naming what is missing. `what` is its
    kind and name, for the message, such as "device acme"."""
    entry = made if isinstance(made, type) else type(made)
    _complain(what, entry, "has no", [name for name in members(contract) if not hasattr(made, name)], contract)


def members(contract: type) -> list[str]:
    """Names of the attributes and methods of a protocol, without those that begin with an underscore."""
    own = (each for each in reversed(contract.__mro__) if getattr(each, "_is_protocol", False))
    return list(dict.fromkeys(name for each in own for name in vars(each) if not name.startswith("_")))


def check_overrides(what: str, entry: type, base: type, *names: str) -> None:
    """See that a class overrides what its base leaves open; raises ValueError naming what it does not."""
    before = entry.__mro__[: entry.__mro__.index(base)]
    missing = [name for name in names if not any(name in vars(each) for each in before)]
    _complain(what, entry, "does not override", missing, base)


def _complain(what: str, entry: type, lacks: str, missing: list[str], contract: type) -> None:
    if missing:
        raise ValueError(
            f"{what}: {entry.__module__}:{entry.__qualname__} {lacks} {', '.join(missing)}; its contract is "
            f"{contract.__module__}.{contract.__qualname__}"
        )
