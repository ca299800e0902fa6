"""The layout of datagrams: its bounds, and that everything survives the wire; `test_one_stream` fixes every bit."""

from itertools import product

import pytest
from hypothesis import given, strategies as st

from tests.protocol.harness import KEY, forms, kind_of
from weberlink.codec import force_channel
from weberlink.protocol import wire
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Checksum
from weberlink.protocol.wire import CLEAR_BYTES, Content, DirectionLayout, Envelope, Kind, Report, UpdateLayout
from weberlink.update import (
    MAX_GAP,
    MAX_SELECTOR,
    MOST_PARAMETER_BYTES,
    ModelParameters,
    PreviousSample,
    Update,
    UpdateForm,
)

LEVEL = st.integers(-32_768, 32_767)
UINT16 = st.integers(0, 2**16 - 1)
PSK_TAG = PresharedKey(KEY).tag_size


def read(direction: DirectionLayout, data: bytes) -> Content:
    return direction.read(data[:1] + data[CLEAR_BYTES:])


def span(acks: int, *parts: str) -> tuple[int, int]:
    """Fewest and most bits of a datagram of these parts, by the table, without groups of levels."""
    fields = [each for part in ("clear", "head", *["ack"] * acks, *parts) for each in wire.TABLE if each.part == part]
    return sum(field.least for field in fields), sum(field.most for field in fields)


@pytest.mark.parametrize(("carries_credit", "acks"), list(product([False, True], [1, 2])))
@pytest.mark.parametrize("groups", [(1,), (2, 2), (3,), (3, 3)])
def test_the_lengths_are_those_of_the_table(groups: tuple[int, ...], carries_credit: bool, acks: int) -> None:
    stream = (UpdateForm(groups, groups), UpdateForm(groups, None))
    direction = DirectionLayout([stream] * acks, carries_credit=carries_credit, acks=acks)
    least, most = sum(4 + count for count in groups), sum(4 + 16 * count for count in groups)
    update = "update", *("update_ticks",) * (acks > 1), *("update_credit",) * carries_credit
    longest = max(span(acks, *update, "parameters")[1], span(acks, *update, "previous")[1] + most) + most
    bits = span(acks, "bye")[0], max(longest, span(acks, "change")[1])
    assert direction.lengths == tuple(-(-each // 8) for each in bits)
    short, long = span(acks, *update)[0] + least, longest
    assert all(layout.lengths == (-(-short // 8), -(-long // 8)) for layout in direction.updates)


TYPICAL = ((-310, 42, 1180), (1520, -2210, -930))
"""Levels of a force of 1.2 N, and of a position 2 to 5 mm from the origin of a grid of 2 um."""
EARLIER = ((-280, 30, 1050), (1490, -2190, -880))


@pytest.mark.parametrize(("predictor", "most"), [("zoh", 24), ("linear", 28), ("plane", 36), ("sphere", 36)])
def test_a_force_update_fits_the_budget(predictor: str, most: int) -> None:
    """With authentication and acknowledgement."""
    channel = force_channel(predictor=predictor)
    (form,) = channel.forms
    levels, previous = (sum(each[: len(form.newest)], ()) for each in (TYPICAL, EARLIER))
    update = Update(9, 0, levels, None if predictor == "zoh" else PreviousSample(40, previous))
    layout = UpdateLayout(channel.forms)
    layout.check(update)
    assert layout.length(update) + PSK_TAG <= most
    assert Checksum().tag_size < PSK_TAG == 8


LEVELS = st.lists(LEVEL, min_size=6, max_size=6).map(tuple)
PAYLOADS = st.one_of(
    st.none(),
    st.builds(PreviousSample, st.integers(1, MAX_GAP), LEVELS),
    st.builds(ModelParameters, st.binary(max_size=MOST_PARAMETER_BYTES)),
)
UPDATES = st.builds(Update, LEVEL, st.integers(0, MAX_SELECTOR), LEVELS, PAYLOADS)
ACKS = st.lists(st.none() | UINT16, min_size=2, max_size=2).map(tuple)
ENVELOPES = st.tuples(UINT16, st.integers(0, 1), st.integers(0, 2**23 - 1), st.integers(0, 255), ACKS)
CREDITS = st.none() | st.integers(0, 2**40)


def layouts(update: Update, credit: int | None) -> DirectionLayout:
    """Of two streams that can carry the update."""
    form = UpdateForm((3, 3), None if isinstance(update.payload, ModelParameters) else (3, 3))
    return DirectionLayout([(form,) * (MAX_SELECTOR + 1)] * 2, carries_credit=credit is not None, acks=2)


@given(ENVELOPES, UPDATES, CREDITS, st.booleans())
def test_an_update_survives_the_wire(envelope: Envelope, update: Update, credit: int | None, second: bool) -> None:
    direction = layouts(update, credit)
    layout = direction.updates[second]
    layout.check(update)
    data = layout.pack(envelope, update.tick, update, credit or 0)
    kind = Kind.SECOND_UPDATE if second else Kind.UPDATE
    assert (kind_of(data), wire.sequence_of(data)) == (kind, envelope[0])
    assert direction.lengths[0] <= len(data) <= direction.lengths[1]
    found = read(direction, data)
    assert found == read(direction, bytes((data[0] | wire.PHASE,)) + data[1:])
    head = (kind, update.payload is not None, update.selector, *envelope[1:])
    assert found == Content(*head, update, credit=None if credit is None else credit % 2**16)


@given(ENVELOPES, UPDATES, CREDITS, st.booleans(), st.integers(0, 10_000), st.sampled_from(["flip", "cut", "more"]))
def test_a_harmed_update_is_refused_or_says_what_an_update_can_say(
    envelope: Envelope, update: Update, credit: int | None, second: bool, place: int, harm: str
) -> None:
    direction = layouts(update, credit)
    layout = direction.updates[second]
    data = bytearray(layout.pack(envelope, update.tick, update, credit or 0))
    if harm == "flip":
        data[place % len(data)] ^= 1 << place % 8
    elif harm == "cut":
        del data[-1 - place % (len(data) - CLEAR_BYTES) :]
    else:
        data += bytes(1 + place % 50)
    try:
        found = read(direction, bytes(data))
    except ValueError:
        return
    if found.update is None:
        return
    layout.check(found.update)
    head = (wire.sequence_of(bytes(data)), found.generation, found.sent, found.echo, found.acks)
    packed = direction.updates[found.kind == Kind.SECOND_UPDATE].pack(
        head, found.update.tick, found.update, found.credit or 0
    )
    assert len(packed) <= len(data), "its widths may be larger than they need be"
    assert read(direction, packed) == found
    assert harm == "flip" or isinstance(update.payload, ModelParameters)


REPORTS = st.builds(
    Report, st.integers(-(2**47), 2**47 - 1), *[st.integers(0, 2**24 - 1)] * 2, *[st.integers(0, 2**16 - 1)] * 3
)


@given(ENVELOPES, UINT16, st.none() | REPORTS, CREDITS, st.none() | UINT16, st.booleans())
def test_a_heartbeat_survives_the_wire(
    envelope: Envelope, ticks: int, report: Report | None, credit: int | None, opening: int | None, flag: bool
) -> None:
    direction = DirectionLayout([forms(3)], carries_credit=credit is not None, acks=2)
    data = wire.pack_heartbeat(envelope, ticks, report, credit, round_trip_ms=opening, asks=flag, is_encoding=not flag)
    selector = (not flag) + 2 * (report is not None) + 4 * (opening is not None)
    truncated = None if credit is None else credit % 2**32
    assert read(direction, data) == Content(
        Kind.HEARTBEAT, flag, selector, *envelope[1:], None, ticks, truncated, report, opening
    )
    for harmed in (data + b"\0", data[:-1]):
        with pytest.raises(ValueError):
            read(direction, harmed)


def test_a_report_saturates() -> None:
    data = wire.pack_heartbeat((5, 0, 6, 7, (None,)), 0, Report(0, 2**40, 2**40, 0, 2**20, 7))
    assert read(DirectionLayout([forms(3)]), data).report == Report(0, 2**24 - 1, 2**24 - 1, 0, 2**16 - 1, 7)


@given(ENVELOPES, st.text(), st.binary(min_size=8, max_size=200), st.integers(0, 2**32 - 1), st.integers(0, 7))
def test_other_kinds_survive_the_wire(envelope: Envelope, reason: str, body: bytes, tick: int, number: int) -> None:
    """A reason is cut at a character."""
    direction = DirectionLayout([forms(3)], acks=2)
    said = read(direction, wire.pack(envelope, Kind.BYE, wire.cut(reason))).data
    assert len(said) <= wire.LONGEST_REASON
    assert reason.encode(errors="replace").decode().startswith(said.decode())
    change = read(direction, wire.pack(envelope, Kind.CHANGE, body, selector=number, tick=tick))
    assert change == Content(Kind.CHANGE, False, number, *envelope[1:], tick=tick, data=body)
    path = read(direction, wire.pack(envelope, Kind.PATH, body[:8], mark=True))
    assert path == Content(Kind.PATH, True, 0, *envelope[1:], data=body[:8])


ENVELOPE: Envelope = (1, 0, 2, 3, (None,))
BODIES = {"change": b"x", "path": bytes(wire.TOKEN_BYTES)}
PADDED = {  # datagrams and their bits after the head, of 33 bits, and before the body
    "update": (UpdateLayout(forms(3)).pack(ENVELOPE, 0, Update(1, 0, (1, 2, 3))), 1 + 4 + 9),
    "update in whole bytes": (UpdateLayout(forms(3)).pack(ENVELOPE, 0, Update(1, 0, (2000, 1, 0))), 1 + 4 + 36),
    "pair": (
        UpdateLayout(forms(3)).pack(ENVELOPE, 0, Update(1, 0, (1, 2, 3), PreviousSample(3, (1, 2, 4)))),
        1 + 4 + 9 + 4 + 1 + 4 + 3,
    ),
    "heartbeat": (wire.pack_heartbeat(ENVELOPE, 5), 16),
    "bye": (wire.pack(ENVELOPE, Kind.BYE, b""), 0),
    "change": (wire.pack(ENVELOPE, Kind.CHANGE, BODIES["change"], selector=4, tick=3), 32),
    "path": (wire.pack(ENVELOPE, Kind.PATH, BODIES["path"], mark=True), 0),
}


@pytest.mark.parametrize("name", PADDED)
def test_a_datagram_ends_where_it_ends_and_zeros_fill_its_last_byte(name: str) -> None:
    data, bits = PADDED[name]
    direction = DirectionLayout([forms(3)])
    read(direction, data)
    end = CLEAR_BYTES - -(33 + bits) // 8
    assert data[end:] == BODIES.get(name, b"")
    harmed = [data[: end - 1] + bytes([data[end - 1] | 1 << bit]) + data[end:] for bit in range(-(33 + bits) % 8)]
    harmed += [data[:size] for size in range(CLEAR_BYTES, len(data))]
    for wrong in [*harmed, data + b"\0"] if name not in ("bye", "change") else harmed:
        with pytest.raises(ValueError):
            read(direction, wrong)


def test_what_no_peer_of_these_layouts_sends_is_refused() -> None:
    direction = DirectionLayout([(UpdateForm((3,), None),)])
    update = Update(1, 0, (1, 2, 3), ModelParameters(bytes(MOST_PARAMETER_BYTES)))
    data = direction.updates[0].pack(ENVELOPE, 0, update)
    assert read(direction, data).update == update._replace(tick=0)
    for first in (data[0] | 1 << 4, Kind.SECOND_UPDATE, Kind.HELLO, Kind.WELCOME):  # selector, stream, kinds
        with pytest.raises(ValueError, match=r"selector|stream|kind"):
            read(direction, bytes((first,)) + data[1:])
    with pytest.raises(ValueError, match="49 bytes"):
        read(direction, data + b"\0")
    for kind, sizes in ((Kind.BYE, [65]), (Kind.CHANGE, [0, 201]), (Kind.PATH, [7, 9])):
        for size in sizes:
            tick = 3 if kind == Kind.CHANGE else None
            with pytest.raises(ValueError, match=f"{size} bytes"):
                read(direction, wire.pack(ENVELOPE, kind, bytes(size), tick=tick))
