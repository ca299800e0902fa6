"""Tables of implementations by name, imported on first use and extended by entry points of other distributions."""

import sys
from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")


def is_hardware(driver: object) -> bool:
    """Whether a driver may move something real: every one may that does not say `COMPUTED = True`."""
    return not getattr(driver, "COMPUTED", False)


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

    def __getitem__(self, name: str) -> T:
        """Import an entry.

        Raises:
            KeyError: no entry has this name.
            ImportError: a package that the entry needs is missing.
            ValueError: the entry of another distribution cannot be imported or used.
        """
        if name not in self._loaded:
            if name in self.built_in:
                entry = self.built_in[name]
                self._loaded[name] = cast(T, resolve(entry)) if isinstance(entry, str) else entry
            else:
                self._loaded[name] = self._load_installed(name)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.built_in, *(name for name in sorted(self._installed) if name not in self.built_in)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in self.built_in or name in self._installed

    def load(self, name: str) -> T:
        """Import an entry; raises as `self[name]`, but ValueError with the nearest name for an unknown one."""
        return self[self.check_known(name)]

    def check_known(self, name: str) -> str:
        """Return the name if an entry has it.

        Raises:
            ValueError: no entry has this name; the message lists all names and the nearest one.
        """
        if name in self:
            return name
        (nearest,) = get_close_matches(name, self, n=1, cutoff=0.0)
        raise ValueError(f"no {self.kind} is called {name!r}; nearest is {nearest!r}, there are {', '.join(self)}")

    def places(self) -> dict[str, str]:
        """Map each name to its "module:attribute", entry points included; for tables whose entries are all places."""
        installed = {name: entry.value for name, entry in self._installed.items()}
        return installed | {name: str(place) for name, place in self.built_in.items()}

    def _load_installed(self, name: str) -> T:
        installed = self._installed[name]
        try:
            entry = installed.load()
        except ImportError:
            raise  # the caller names the missing package
        except Exception as error:
            raise ValueError(f"{self.kind} {name}: {installed.value} cannot be imported: {error}") from error
        self._check(name, entry)
        return cast(T, entry)

    @property
    def _installed(self) -> Mapping[str, "EntryPoint"]:
        return {} if self.group is None else _installed(self.group, tuple(sys.path))


@lru_cache
def _installed(group: str, path: tuple[str, ...]) -> Mapping[str, "EntryPoint"]:  # noqa: ARG001 - the key of the cache
    from importlib.metadata import entry_points  # noqa: PLC0415 - with its parsers as long an import as all of ours

    return {entry.name: entry for entry in entry_points(group=group)}


def resolve(place: str) -> Any:
    """Import "module:attribute".

    Raises:
        ImportError: the module, or a package that it needs, is missing.
        AttributeError: the module has no such attribute.
    """
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute)


def check_contract(what: str, made: object, contract: type) -> None:
    """See that an object, or a class, has all that a protocol names.

    Args:
        what: kind and name, for the message, such as "device acme".
        made: the object.
        contract: the protocol.

    Raises:
        ValueError: naming what is missing.
    """
    missing = [name for name in members(contract) if not hasattr(made, name)]
    if missing:
        of = made if isinstance(made, type) else type(made)
        raise ValueError(
            f"{what}: {of.__module__}:{of.__qualname__} has no {', '.join(missing)}; its contract is "
            f"{contract.__module__}.{contract.__qualname__}"
        )


def members(contract: type) -> list[str]:
    """Names of the attributes and methods of a protocol, without those that begin with an underscore."""
    own = (each for each in reversed(contract.__mro__) if getattr(each, "_is_protocol", False))
    return list(dict.fromkeys(name for each in own for name in vars(each) if not name.startswith("_")))


def check_overrides(what: str, entry: type, base: type, *names: str) -> None:
    """See that a class overrides what its base leaves open; raises ValueError naming what it does not."""
    before = entry.__mro__[: entry.__mro__.index(base)]
    missing = [name for name in names if not any(name in vars(each) for each in before)]
    if missing:
        raise ValueError(
            f"{what}: {entry.__module__}:{entry.__qualname__} does not override {', '.join(missing)}; its contract is "
            f"{base.__module__}.{base.__qualname__}"
        )
