"""The facts of paths: read from a description, put into words, compared."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from weberlink.figures.paths import LONGEST, MOST, LinkPath, finding, notable, paths_of
from weberlink.protocol.aio.udp import PathFacts

RELAYED = PathFacts(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)
DIRECT = PathFacts(remote="10.0.0.2:47000")
NONE = PathFacts(route="", note="asking the mailbox")
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from([*PathFacts._fields, "dscp"]), inner),
    max_leaves=20,
)


def facts(*paths: PathFacts, **other: Any) -> list[LinkPath]:
    """As a daemon publishes them, read again."""
    return paths_of({"paths": [path._asdict() | other for path in paths]})


def test_facts_of_the_daemon_come_through_whole() -> None:
    assert facts(RELAYED, DIRECT, dscp=46) == [LinkPath(*path[:-1], 46) for path in (RELAYED, DIRECT)]
    assert facts(RELAYED)[0].dscp is None
    assert paths_of(None) == paths_of({}) == []


@given(anything)
def test_a_strange_description_gives_words_all_the_same(found: Any) -> None:
    paths = paths_of({"paths": found})
    assert len(paths) <= MOST
    for path in paths:
        assert len(path.words()) < 3 * LONGEST
        assert isinstance(path.dscp_words(46), str)
    assert isinstance(finding(paths), str)
    assert all(isinstance(text, str) for text in notable([], paths))


def test_notable_are_other_routes_and_changes() -> None:
    assert list(notable([], facts(DIRECT, NONE))) == []
    assert list(notable([], facts(RELAYED))) == ["path: relayed by relay.example over wlan0, 1 change"]
    assert list(notable(facts(RELAYED), facts(RELAYED, dscp=46))) == []
    assert list(notable(facts(DIRECT), facts(DIRECT._replace(changes=1)))) == ["path: direct, 1 change"]
    assert finding(facts(NONE)) == "asking the mailbox" and finding(facts(NONE, DIRECT)) == finding([]) == ""
