"""What a daemon tells of its paths, in words, whatever a description holds."""

from typing import Any

from hypothesis import given, strategies as st

from weberlink.protocol.paths import LONGEST, MOST, LinkPath, finding, notable, paths_of

RELAYED = LinkPath(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)
DIRECT = LinkPath(remote="10.0.0.2:47000")
UNFOUND = LinkPath(route="", note="asking the mailbox")
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(LinkPath._fields), inner),
    max_leaves=20,
)


def test_facts_of_the_daemon_come_through_whole() -> None:
    known = [RELAYED, DIRECT, UNFOUND._replace(dscp=46)]
    assert paths_of({"paths": [path._asdict() for path in known]}) == known
    assert paths_of(None) == paths_of({}) == []


@given(anything)
def test_a_strange_description_gives_words_all_the_same(found: Any) -> None:
    paths = paths_of({"paths": found})
    assert len(paths) <= MOST
    for path in paths:
        assert len(path.words()) < 3 * LONGEST
    assert isinstance(finding(paths), str)
    assert all(isinstance(text, str) for text in notable([], paths))


def test_notable_are_other_routes_and_changes() -> None:
    assert list(notable([], [DIRECT, UNFOUND])) == []
    assert list(notable([], [RELAYED])) == ["path: relayed by relay.example over wlan0, 1 change"]
    assert list(notable([RELAYED], [RELAYED._replace(dscp=46)])) == []
    assert list(notable([DIRECT], [DIRECT._replace(changes=1)])) == ["path: direct, 1 change"]
    assert finding([UNFOUND]) == "asking the mailbox" and finding([UNFOUND, DIRECT]) == finding([]) == ""
