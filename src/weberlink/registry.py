"""A table of implementations by name, imported only on use and extended by entry points of other distributions."""

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar, cast

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Maps names to objects. Built-in names win over entry points of the same name.

    Installed distributions are searched only for a name that is not built in, or to list all names.

    Args:
        group: of the entry points.
        noun: what an entry is, for error messages.
        built_in: where each built-in object is ("module:attribute"), in the order in which names are listed.
        check: raises ValueError for an object of another distribution that cannot be used.
    """

    def __init__(
        self,
        group: str,
        noun: str,
        built_in: Mapping[str, str],
        check: Callable[[str, Any], None] = lambda _name, _entry: None,
    ) -> None:
        self.group = group
        self.noun = noun
        self.built_in = tuple(built_in)
        self._places = built_in
        self._check = check
        self._loaded: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        """The object of a name; raises KeyError for an unknown name, ImportError where its package is missing."""
        if name not in self._loaded:
            if name in self._places:
                module, _, attribute = self._places[name].partition(":")
                self._loaded[name] = cast(T, getattr(import_module(module), attribute))
            else:
                entry = self._installed[name].load()
                self._check(name, entry)
                self._loaded[name] = cast(T, entry)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.built_in, *(name for name in sorted(self._installed) if name not in self._places)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in self._places or name in self._installed

    def check_known(self, name: str) -> str:
        """The name itself.

        Raises:
            ValueError: if nothing has this name; the text lists the names and says which is nearest.
        """
        if name in self:
            return name
        nearest = get_close_matches(name, list(self), n=1, cutoff=0.0)
        hint = f"; nearest is {nearest[0]!r}" if nearest else ""
        raise ValueError(f"no {self.noun} is called {name!r}{hint}, there are {', '.join(self)}")

    @cached_property
    def _installed(self) -> dict[str, EntryPoint]:
        return {entry.name: entry for entry in entry_points(group=self.group)}
