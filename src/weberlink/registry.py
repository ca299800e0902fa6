"""Named tables of "module:attribute", imported only on use and extended by entry points of other distributions."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import entry_points
from typing import Generic, TypeVar, cast

Entry = TypeVar("Entry")


class Registry(Generic[Entry]):
    """Built-in entries win over entry points of the same name.

    Args:
        kind: what an entry is, for error messages, such as "robot".
        built_in: name to "module:attribute".
        group: group of entry points that extends the table; None for a closed table.
    """

    def __init__(self, kind: str, built_in: Mapping[str, str], group: str | None = None) -> None:
        self.kind = kind
        self.built_in = dict(built_in)
        self.group = group

    def __iter__(self) -> Iterator[str]:
        return iter(self.built_in)

    def entries(self) -> dict[str, str]:
        """Name to "module:attribute", entry points included."""
        found = {} if self.group is None else {entry.name: entry.value for entry in entry_points(group=self.group)}
        return found | self.built_in

    def load(self, name: str) -> Entry:
        """Import an entry.

        Raises:
            ValueError: no entry has this name.
            ImportError: a package that the entry needs is missing.
        """
        # Entry points are looked up for other names only: that reads the metadata of every installed distribution.
        table = self.built_in if name in self.built_in else self.entries()
        if name not in table:
            (nearest,) = get_close_matches(name, table, n=1, cutoff=0.0)
            raise ValueError(
                f"no {self.kind} is called {name!r}; nearest is {nearest!r}, there are {', '.join(sorted(table))}"
            )
        module, _, attribute = table[name].partition(":")
        return cast(Entry, getattr(import_module(module), attribute))
