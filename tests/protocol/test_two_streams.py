"""Two streams of updates each way: each comes through, is repeated and restored by itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.protocol.harness import MENDED_WITHIN, Pair, Side, forms, make_endpoint, sample_update, suites
from weberlink.protocol import DropReason, PeerSilent, Role, State, UpdateReceived
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.wire import Kind, kind_of
from weberlink.update import PreviousSample, Update

BOTH = {"outgoing": (forms(3), forms(3)), "incoming": (forms(3), forms(3))}


def two(**changes: object) -> Pair:
    arguments = {"master": BOTH, "slave": BOTH, **changes}
    return Pair(**arguments)  # type: ignore[arg-type]


def of(side: Side, stream: int) -> list[UpdateReceived]:
    return [event for event in side.updates() if event.stream == stream]


@pytest.mark.parametrize("security", suites())
def test_updates_of_each_stream_arrive_once_and_unchanged(security: object) -> None:
    sent: dict[int, list[int]] = {0: [], 1: []}

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for stream, pace in ((0, 7), (1, 11)):
            if 200 < tick < 2000 and tick % pace == 0:
                sent[stream].append(pair.master.send(pair.now, pair.ticks, stream))

    ends = {**BOTH, "security": security}
    pair = two(master=ends, slave=ends, on_tick=on_tick).engage().run(2.0)
    for stream in (0, 1):
        received = of(pair.slave, stream)
        assert [event.update.tick for event in received] == sent[stream]
        assert all(event.update == sample_update(event.update.tick) for event in received)
    assert pair.master.endpoint.statistics.updates_sent == [len(sent[0]), len(sent[1])]
    assert pair.slave.endpoint.statistics.updates_received == [len(sent[0]), len(sent[1])]
    assert pair.master.endpoint.statistics.repeats == 0


def test_streams_may_differ_in_size() -> None:
    pair = two(
        master={"outgoing": (forms(3), forms(1)), "incoming": (forms(2), forms(6))},
        slave={"outgoing": (forms(2), forms(6)), "incoming": (forms(3), forms(1))},
    ).engage()
    six = Update(200, 2, (1, 2, 3, 4, 5, 6), PreviousSample(1, (6, 5, 4, 3, 2, 1)))
    pair.slave.endpoint.send_update(pair.now, Update(200, 1, (1, 2)))
    pair.slave.endpoint.send_update(pair.now, six, stream=1)
    pair.master.endpoint.send_update(pair.now, Update(200, 3, (-7,)), stream=1)
    pair.run(0.01)
    assert [(event.stream, event.update) for event in pair.master.updates()] == [(0, Update(200, 1, (1, 2))), (1, six)]
    assert [(event.stream, event.update.newest) for event in pair.slave.updates()] == [(1, (-7,))]


@pytest.mark.parametrize("missing", [0, 1])
def test_loss_of_one_stream_is_not_hidden_by_the_other(missing: int) -> None:
    """The update of one is lost and that of the other, later, arrives: only the lost one is sent again."""
    pair = two().engage().run(1.0)
    kind = (Kind.UPDATE, Kind.SECOND_UPDATE)[missing]
    pair.swallow = lambda side, data: kind_of(data) == kind
    lost = pair.master.send(pair.now, pair.ticks, missing)
    pair.run(0.001)
    pair.swallow = lambda side, data: False
    pair.master.send(pair.now, pair.ticks, 1 - missing)
    pair.run(MENDED_WITHIN)
    assert [event.update.tick for event in of(pair.slave, missing)] == [lost]
    assert len(of(pair.slave, 1 - missing)) == 1
    assert pair.master.endpoint.statistics.repeats == 1


@pytest.mark.parametrize("missing", [0, 1])
def test_evidence_of_one_stream_brings_its_repeat_forward(missing: int) -> None:
    pair = two().engage().run(1.0)
    pair.swallow = lambda side, data: side is pair.master
    lost = pair.master.send(pair.now, pair.ticks, missing)
    pair.run(0.004)
    pair.swallow = lambda side, data: False
    pair.master.send(pair.now, pair.ticks, 1 - missing)
    pair.run(0.002)
    pair.slave.send(pair.now, pair.ticks, 0)  # which acknowledges the one and not the other
    pair.run(0.01)
    assert [event.update.tick for event in of(pair.slave, missing)] == [lost]


@pytest.mark.parametrize("first", [0, 1])
def test_neither_supersedes_the_other(first: int) -> None:
    """Reordered on the way, both are delivered; an older one of the same stream is not."""
    pair = two().engage()
    datagrams, start = [], pair.ticks
    for stream, tick in ((first, start), (1 - first, start + 1), (first, start + 2)):
        pair.master.endpoint.send_update(pair.now, sample_update(tick), stream=stream)
        datagrams += pair.master.endpoint.datagrams_to_send()
    for data, _ in reversed(datagrams):
        pair.slave.endpoint.receive_datagram(data, pair.master.address, pair.now + 0.001)
    pair.slave.collect(pair.now)
    delivered = [(event.stream, event.update.tick) for event in pair.slave.updates()]
    assert delivered == [(first, start + 2), (1 - first, start + 1)]
    assert pair.slave.faults() == [DropReason.SUPERSEDED]


@examples(20)
@given(
    st.integers(0, 2**32),
    st.lists(st.booleans(), max_size=40),
    st.lists(st.booleans(), max_size=40),
    st.tuples(st.integers(1, 30), st.integers(1, 30)),
    st.sampled_from([0.0, 0.001, 0.02, 0.045]),
    st.booleans(),
)
def test_newest_updates_arrive_after_any_pattern_of_losses(
    seed: int, forward: list[bool], backward: list[bool], gaps: tuple[int, int], delay: float, doubled: bool
) -> None:
    """For 80 ms, any of the first datagrams of each direction are lost; the rest are late, reordered or doubled."""
    link = Emulation(delay_s=delay, jitter_s=0.002, reorder=0.1, duplicate=0.2 * doubled)
    newest = [-1, -1]
    ends_at = 0.28

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for stream, gap in enumerate(gaps):
            if 0.2 <= now < ends_at and tick % gap == 0:
                newest[stream] = pair.master.send(pair.now, pair.ticks, stream)

    pair = two(seed=seed, forward=link, backward=link, on_tick=on_tick).engage()
    fates = {id(pair.master): iter(forward), id(pair.slave): iter(backward)}
    pair.swallow = lambda side, data: pair.now < ends_at and next(fates[id(side)], False)
    pair.run(ends_at - pair.now)
    pair.run(MENDED_WITHIN + 2.0 * (delay + 0.002))
    if pair.master.of(PeerSilent) or pair.slave.of(PeerSilent):  # their owners are told, and begin anew
        pair.run(1.0)
        assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    else:
        assert [[event.update.tick for event in of(pair.slave, stream)][-1:] for stream in (0, 1)] == [
            [tick] if tick >= 0 else [] for tick in newest
        ]


def test_an_end_of_one_stream_refuses_the_other_kind() -> None:
    pair = Pair(
        master={"outgoing": (forms(3),), "incoming": (forms(3),)},
        slave={"outgoing": (forms(3),), "incoming": (forms(3),)},
    )
    pair.engage()
    pair.master.send(pair.now, pair.ticks, 0)
    ((data, _),) = pair.master.endpoint.datagrams_to_send()
    pair.slave.endpoint.receive_datagram(
        bytes([data[0] | Kind.SECOND_UPDATE]) + data[1:], pair.master.address, pair.now
    )
    pair.slave.collect(pair.now)
    assert pair.slave.faults() == [DropReason.UNKNOWN_KIND]
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED


@pytest.mark.parametrize("levels", [(), (3, 3, 3), (3, 0)])
def test_only_one_or_two_streams_of_updates_are_built(levels: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="1 to"):
        make_endpoint(Role.RESPONDER, outgoing=[forms(count) for count in levels])
