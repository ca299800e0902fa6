"""What the doctor says of NAT and firewall."""

from typing import Any

import pytest

from weberlink.cli.doctor import Grade
from weberlink_anywhere.doctor import judge
from weberlink_anywhere.nat import ANY, Behaviour, Nat
from weberlink_anywhere.options import AnywhereOptions
from weberlink_anywhere.stun import WayOut

FILE_OPTIONS = {"mailbox": "ws://a/v1", "stun": "relay.example:3478", "turn": {"server": "a:1", "secret_file": "s"}}
SERVER, HERE = ("203.0.113.1", 3478), ("198.51.100.7", 20_000)
INDEPENDENT, BOTH = frozenset({Behaviour.INDEPENDENT}), frozenset({Behaviour.ADDRESS_AND_PORT})
MAPPED, UNCLEAR = WayOut(Nat(SERVER, HERE, True, BOTH, BOTH)), WayOut(Nat(SERVER, HERE, True, ANY, ANY))
REACHED = WayOut(Nat(SERVER, HERE, True, INDEPENDENT, INDEPENDENT))
BLOCKED = WayOut(None, by_tcp=("relay.example:3478",))


@pytest.mark.parametrize(
    ("way_out", "overrides", "grade", "fix"),
    [
        (REACHED, {}, Grade.OK, None),
        (MAPPED, {}, Grade.OK, None),  # the file has a relay
        (MAPPED, {"turn": None}, Grade.ADVICE, "link.finder.turn"),
        (UNCLEAR, {}, Grade.UNKNOWN, "docs/relay.md"),
        (BLOCKED, {}, Grade.PROBLEM, "another network"),
        (WayOut(None, unresolved=("a.b",)), {}, Grade.PROBLEM, "link.finder.stun"),
    ],
)
def test_way_out_is_judged(way_out: WayOut, overrides: dict[str, Any], grade: Grade, fix: str | None) -> None:
    first, *others = judge(way_out, AnywhereOptions.model_validate(FILE_OPTIONS | overrides))
    assert first.grade is grade
    assert first.fix is None if fix is None else fix in (first.fix or "")
    assert [(each.check, each.grade) for each in others] == [("filtering", Grade.OK)] * (way_out.nat is not None)
