"""The paths that a link takes, as a daemon describes them, and in words.

`paths_of` reads them from a description, which another release or another host may have written.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

DIRECT, RELAYED = "direct", "relayed"
MOST, LONGEST = 8, 200  # paths that are read, and characters of each of their texts


class LinkPath(NamedTuple):
    """A path in use, in words, for people: the page, the report, the metrics."""

    place: int = 0  # which of several it is
    route: str = DIRECT  # "direct", "punched", "relayed", or "" while there is none
    via: str = ""  # name of the relay
    interface: str = ""  # network interface of this host
    remote: str = ""  # address of the peer or of the relay, host:port
    changes: int = 0  # how often this path was replaced by another one
    note: str = ""  # what is being done while there is no path, or why there will be none
    dscp: int | None = None  # class of service with which datagrams of the peer arrive (RFC 2474); None while unknown

    @property
    def as_event(self) -> "LinkPath":
        """That of it whose change is worth an event; the class of service is measured now and then."""
        return self._replace(dscp=None)

    @property
    def route_words(self) -> str:
        """The way: direct, punched, relayed by NAME; over which interface; or why there is none."""
        if not self.route:
            return self.note or "no path yet"
        word = f"relayed by {self.via}" if self.route == RELAYED and self.via else self.route
        return f"{word} over {self.interface}" if self.interface else word

    def words(self, of: str = "") -> str:
        """In a few words, with the side whose it is if given; the second one with its number."""
        number = f" {self.place + 1}" if self.place else ""
        changes = f", {self.changes} change{'' if self.changes == 1 else 's'}" if self.changes else ""
        return f"path{number}{of and f' of the {of}'}: {self.route_words}{changes}"


def paths_of(described: Mapping[str, Any] | None) -> list[LinkPath]:
    """The paths in a description or in the summary of a daemon, each value of its type; empty where none is known."""
    found = (described or {}).get("paths")
    paths = found[:MOST] if isinstance(found, list) else []
    return [path_in(facts) for facts in paths if isinstance(facts, Mapping)]


def path_in(facts: Mapping[str, Any]) -> LinkPath:
    """The path that some facts tell, each value of its type."""
    texts, numbers = ("route", "via", "interface", "remote", "note"), ("place", "changes", "dscp")
    told: dict[str, Any] = dict.fromkeys(texts, "")
    told |= {name: text[:LONGEST] for name in texts if isinstance(text := facts.get(name), str)}
    return LinkPath(**told | {name: each for name in numbers if isinstance(each := facts.get(name), int)})


def notable(before: Sequence[LinkPath], now: Sequence[LinkPath]) -> Iterator[str]:
    """The paths that are new or different, in words; not a direct one that was never anything else."""
    known = {path.place: path.as_event for path in before}
    for path in now:
        is_plain = path.route == DIRECT and not path.changes
        if known.get(path.place) != path.as_event and path.route and not is_plain:
            yield path.words()


def finding(paths: Sequence[LinkPath]) -> str:
    """What is being done while there is no path at all; "" if there is one, or nothing is known."""
    if not paths or any(path.route for path in paths):
        return ""
    return next((path.note for path in paths if path.note), "finding a path")
