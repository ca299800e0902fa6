"""A peer that holds the keys may say what it likes: no tick of a side raises, and the fault is counted."""

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from hypothesis import example, given, strategies as st

from tests.compiled import replaces_methods
from tests.examples import examples
from tests.session.hostile import Content, Duel
from tests.session.systems import ARMS, HAS_ARMS, configuration
from weberlink.config import Configuration
from weberlink.protocol.endpoint import QUEUED_EVENTS
from weberlink.protocol.wire import LONGEST_CHANGE, Kind
from weberlink.session.tuning import Tuning
from weberlink.update import MAX_GAP, MOST_PARAMETER_BYTES, ModelParameters, PreviousSample

LOCAL = ("link.security=none", "link.listen=127.0.0.1:0", "link.slave=127.0.0.1:0")
SMOOTH = ("codec.force.smooth_ms=10", "link.playout_ms=5")
SYSTEMS: dict[str, tuple[str, ...]] = {
    "none": ("control.scheme=none",),
    "smooth": ("codec.position.predictor=hybrid", "control.scheme=none", *SMOOTH),
    "bounded": ("codec.position.predictor=hybrid", "control.scheme=bounded"),
}
FILES = {"rotation": "rotation.yaml", **({"arms": ARMS} if HAS_ARMS else {})}


@cache
def configured(name: str) -> Configuration:
    return configuration(*LOCAL, *SYSTEMS.get(name, ()), file=FILES.get(name, "loopback.yaml"))


level = st.sampled_from([-(2**15), -(2**15) + 1, -1, 0, 1, 2**15 - 1]) | st.integers(-(2**15), 2**15 - 1)
levels = st.lists(level, min_size=1, max_size=8).map(tuple)


payloads = (
    st.none()
    | st.builds(PreviousSample, st.sampled_from([1, 2, 10, MAX_GAP]) | st.integers(1, MAX_GAP), levels)
    | st.builds(ModelParameters, st.binary(max_size=MOST_PARAMETER_BYTES))
)
BODIES = [
    b"", b"\x00", b"\x01", b"{}", b"[]", b"null", b"1", b'{"weber":0.2}', b'{"weber":1e999}', b'{"weber":NaN}',
    b'{"weber":true}', b'{"predictor":"zoh"}', b'{"predictor":null}', b'{"scheme":"none"}',
    b'{"weber":"\\ud800"}', b'{"\\ud800":1}', b"[" * LONGEST_CHANGE, b'{"weber":' + b"9" * 180 + b"}",
]  # fmt: skip
bodies = st.sampled_from(BODIES) | st.binary(max_size=LONGEST_CHANGE)
numbers = st.sampled_from([1, 1, 2, *range(8)])


def moves_with(payloads: st.SearchStrategy[Any]) -> st.SearchStrategy[list[tuple[Any, ...]]]:
    """What a peer and the own user do, with updates of such payloads."""
    contents = st.builds(Content, st.integers(0, 1), st.integers(0, 7), st.integers(-90, 1000), levels, payloads)
    return st.lists(st.one_of(
        st.tuples(st.just("update"), contents),
        st.tuples(st.just("update"), contents),
        st.tuples(st.just("change"), numbers, st.integers(-3000, 3000), bodies, st.booleans()),
        st.tuples(st.just("garble"), st.sampled_from([k for k in Kind if k not in (Kind.HELLO, Kind.WELCOME)]),
                  st.integers(0, 255), st.binary(max_size=60)),
        st.tuples(st.just("credit"), st.integers(0, 2**40)),
        st.tuples(st.just("encoding"), st.booleans()),
        st.tuples(st.just("renew"), st.none() | st.text(max_size=70)),
        st.tuples(st.just("ask"), st.sampled_from([{"weber": 0.3}, {"predictor": "zoh"}, {"scheme": "none"}])),
        st.tuples(st.just("tick"), st.integers(1, 12)),
    ), min_size=1, max_size=30)  # fmt: skip


def move(duel: Duel, kind: str, *what: Any) -> None:
    peer, side = duel.peer, duel.side
    match kind:
        case "update":
            duel.update(*what)
        case "change":
            number, ahead, body, is_answer = what
            duel.change(number, ahead, body, is_answer=is_answer)
        case "garble":
            duel.garble(*what)
        case "credit":
            peer.grant(max(peer.credit.granted, *what))
        case "encoding":
            peer.report_encoding(duel.now, is_encoding=what[0])
        case "renew":
            duel.renew(*what)
        case "ask":
            side.propose(*what, duel.now)
        case "tick":
            duel.tick(*what)


PROPOSED = ("change", 1, 100, b'{"weber":0.2}', False)


@pytest.mark.parametrize("hero", ["master", "slave"])
@pytest.mark.parametrize("name", [*SYSTEMS, *FILES])
@given(played=moves_with(payloads))
@example(played=[PROPOSED, ("renew", "bye")])  # the proposal is still queued when the next session begins
@example(played=[("renew", "bye"), ("ask", {"weber": 0.3}), ("tick", 1), ("ask", {"weber": 0.3})])
@examples(15)
def test_no_tick_raises_whatever_an_authentic_peer_says(name: str, hero: str, played: list[Any]) -> None:
    """Of any predictor and control scheme, at either end, with what it is asked by its own user meanwhile."""
    play(configured(name), hero, played)


def play(loaded: Configuration, hero: str, played: list[Any]) -> None:
    duel = Duel(loaded, hero)
    duel.engage()
    for kind, *what in played:
        move(duel, kind, *what)
    duel.tick(20)


@pytest.mark.parametrize("hero", ["master", "slave"])
def test_a_session_begins_even_if_its_first_tick_has_more_events_than_the_queue(hero: str) -> None:
    duel = Duel(configured("none"), hero)
    duel.engage()
    duel.change(1, 100, b'{"weber":0.3}', is_answer=False)
    duel.tick(120)
    assert duel.side.tuning.settings.weber == 0.3
    duel.renew("bye")
    before = duel.side.endpoint.statistics.updates_received[0]
    for index in range(QUEUED_EVENTS + 5):
        assert duel.update(Content(0, 0, 0, (index,), None))
        duel.carry()
    assert duel.side.endpoint.statistics.updates_received[0] - before > QUEUED_EVENTS
    duel.tick()
    assert duel.side.tuning.settings.weber == configured("none").system.codec.force.weber


# The boundary: parts of a side that fail at what the peer says, as one with an error would.

REPEATS = 3
GOOD = Content(0, 0, 0, (50,), None)


class Unreadable(tuple[str, ...]):
    """Names that cannot be compared with what a peer says."""

    def __contains__(self, name: object) -> bool:
        raise RecursionError


def refuse(*_: object) -> None:
    raise LookupError


def failing_once(method: Callable[..., Any]) -> Callable[..., Any]:
    errors = [ZeroDivisionError()]

    def fails(*contents: Any) -> Any:
        if errors:
            raise errors.pop()
        return method(*contents)

    return fails


@replaces_methods
@pytest.mark.parametrize("hero", ["master", "slave"])
@pytest.mark.parametrize("where", ["apply", "value", "answer", "change"])
def test_whatever_fails_at_contents_of_the_peer_is_its_fault_and_the_loop_goes_on(where: str, hero: str) -> None:
    duel = Duel(configured("none"), hero)
    side = duel.side
    duel.engage()
    assert duel.update(GOOD)
    duel.tick(5)
    held = side.incoming[0].decoder
    assert held.newest is not None and not side.faults
    if where in ("apply", "value"):
        at: Any = held if where == "apply" else side.incoming[0]
        setattr(at, where, failing_once(getattr(at, where)))
        assert duel.update(GOOD)
    else:
        side.tuning = Tuning(side.tuning.settings, {"weber": (), "predictor": Unreadable()}, refuse)
        asked = b'{"predictor":"zoh"}' if where == "answer" else b'{"weber":0.2}'
        duel.change(1, 100, asked, is_answer=False)
    while not side.faults:
        duel.tick()
    assert side.faults == {"update": 1}
    assert held.newest is None, "nothing is held of a peer that does not keep to what it has agreed to"
    duel.tick(50)
    assert side.faults["update"] <= REPEATS, "as often as it was sent, not in every tick"
    counted = dict(side.faults)
    assert duel.update(GOOD)
    duel.tick(5)
    assert held.newest is not None and side.engaged
    assert side.faults == counted
