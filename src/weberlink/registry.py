"""Tables of implementations by name, imported only on use and extended by entry points of other distributions."""

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar, cast

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Maps names to objects; built-in names win over entry points of the same name.

    Installed distributions are searched only for a name that is not built in, or to list all names, because that reads
    the metadata of every one of them. Names are listed in the order of `built_in`, then alphabetically.

    Args:
        kind: what an entry is, for error messages, such as "robot".
        built_in: each built-in object, or where it is ("module:attribute").
        group: group of entry points that extends the table; None for a closed table.
        check: raises ValueError for an object of another distribution that cannot be used.
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
            ValueError: the entry of another distribution cannot be used.
        """
        if name not in self._loaded:
            if name in self.built_in:
                self._loaded[name] = _resolve(self.built_in[name])
            else:
                entry = self._installed[name].load()
                self._check(name, entry)
                self._loaded[name] = cast(T, entry)
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
            ValueError: no entry has this name; the text lists the names and says which is nearest.
        """
        if name in self:
            return name
        (nearest,) = get_close_matches(name, self, n=1, cutoff=0.0)
        raise ValueError(f"no {self.kind} is called {name!r}; nearest is {nearest!r}, there are {', '.join(self)}")

    def places(self) -> dict[str, str]:
        """Name to "module:attribute", entry points included; for tables whose built-in entries are places."""
        installed = {name: entry.value for name, entry in self._installed.items()}
        return installed | {name: str(place) for name, place in self.built_in.items()}

    @property
    def _installed(self) -> dict[str, EntryPoint]:
        return {} if self.group is None else {entry.name: entry for entry in entry_points(group=self.group)}


def _resolve(entry: T | str) -> T:
    if not isinstance(entry, str):
        return entry
    module, _, attribute = entry.partition(":")
    return cast(T, getattr(import_module(module), attribute))
