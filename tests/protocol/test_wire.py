"""The layout of datagrams: what the table of the module says, and that everything survives the wire."""

import ast
import re
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.protocol.harness import KEY, forms
from weberlink.codec import force_channel
from weberlink.protocol import DropReason, wire
from weberlink.protocol import bits as strings
from weberlink.protocol.bits import MalformedError
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import (
    CLEAR_BYTES,
    ByeContent,
    ChangeContent,
    DirectionLayout,
    Envelope,
    HeartbeatContent,
    Kind,
    PathContent,
    Report,
    UpdateContent,
    UpdateLayout,
)
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
PSK_TAG = PresharedKey(KEY).tag_size
WIDEST = -32_768


def documented() -> dict[str, tuple[int, int]]:
    """Fewest and most bits of each part, from the table of the module, without groups."""
    sizes: dict[str, tuple[int, int]] = {}
    # From the source: a compiled module has no docstring.
    table = ast.get_docstring(ast.parse(Path(wire.__file__).with_name("wire.py").read_text(encoding="utf-8")))
    rows = re.findall(r"^\| (\w+) \| (\w+) \| (\d+)(?:-(\d+))? (bits?|bytes) \|", table or "", re.MULTILINE)
    for part, _, low, high, unit in rows:
        scale = 8 if unit == "bytes" else 1
        least, most = sizes.get(part, (0, 0))
        sizes[part] = least + scale * int(low), most + scale * int(high or low)
    return sizes


@pytest.mark.parametrize(("carries_credit", "acks"), list(product([False, True], [1, 2])))
@pytest.mark.parametrize("groups", [(1,), (2, 2), (3,), (3, 3)])
def test_documented_sizes_are_those_of_the_code(groups: tuple[int, ...], carries_credit: bool, acks: int) -> None:
    stream = (UpdateForm(groups, groups), UpdateForm(groups, None))
    direction = DirectionLayout([stream] * acks, carries_credit=carries_credit, acks=acks)
    limits, count = direction.lengths(0), sum(groups)
    envelopes: list[Envelope] = [(1, 0, 2, 3, (None,) * acks), (1, 1, 2, 3, (7,) * acks)]
    for ends, level in enumerate((0, WIDEST)):
        head = ["clear", "head", *["ack"] * (acks * ends)]
        update = ["update", *["lag"] * ends, *["update_credit"] * carries_credit]
        levels = (level,) * count

        def size(*parts: str, groups: tuple[int, ...] = (), head: list[str] = head, ends: int = ends) -> int:
            sizes, width = documented(), (1, 16)[ends]
            bits = sum(sizes[part][ends] for part in (*head, *parts) if part != "parameters")
            bits += acks - 1  # of the fields `tells` the table counts one
            bits += sum(4 + width * number for number in groups)
            return -(-bits // 8) + ("parameters" in parts) * sizes["parameters"][ends] // 8

        for layout in direction.updates:
            plain = layout.pack(envelopes[ends], WIDEST * ends, Update(9, 0, levels), 8)
            assert len(plain) == size(*update, groups=groups)
            gap = (1, MAX_GAP)[ends]
            paired = layout.pack(
                envelopes[ends], WIDEST * ends, Update(9, 0, levels, PreviousSample(gap, (0,) * count))
            )
            assert len(paired) == size(*update, "previous", groups=groups * 2)
            data = ModelParameters(bytes(MOST_PARAMETER_BYTES * ends))
            parametric = layout.pack(envelopes[ends], WIDEST * ends, Update(9, 1, levels, data))
            assert len(parametric) == size(*update, "parameters", groups=groups)
            bounds = limits[paired[0] & 0xF]
            assert bounds == limits[plain[0] & 0xF]
            assert bounds[ends] == (len(plain), max(len(paired), len(parametric)))[ends]
        credit = 9 if carries_credit else None
        pulse = wire.pack_heartbeat(
            envelopes[ends], 5, Report(0, 0, 0, 0, 0, 0) if ends else None, credit, round_trip_ms=7 if ends else None
        )
        assert len(pulse) == size("heartbeat", *["heartbeat_credit"] * carries_credit, *["report", "opening"] * ends)
        assert limits[pulse[0] & 0xF][ends] == len(pulse)
        bye = wire.pack_bye(envelopes[ends], "x" * 100 * ends)
        assert len(bye) == size("bye") == limits[bye[0] & 0xF][ends]
        change = wire.pack_change(envelopes[ends], 3, 4, b"x" * (1 + 300 * ends), is_answer=True)
        assert len(change) == size("change") == limits[change[0] & 0xF][ends]
        path = wire.pack_path(envelopes[ends], bytes(wire.TOKEN_BYTES), is_answer=True)
        assert len(path) == size("path") == limits[path[0] & 0xF][ends]
    assert set(documented()) == {
        *("clear", "head", "ack", "update", "lag", "previous", "update_credit", "parameters"),
        *("heartbeat", "heartbeat_credit", "report", "opening", "bye", "change", "path"),
    }


TYPICAL = ((-310, 42, 1180), (1520, -2210, -930))
"""Levels of a force of 1.2 N, and of a position 2 to 5 mm from the origin of a grid of 2 um."""
EARLIER = ((-280, 30, 1050), (1490, -2190, -880))


@pytest.mark.parametrize(
    ("predictor", "most"), [("zoh", 24), ("linear", 28), ("plane", 36), ("sphere", 36), ("surface", 34)]
)
def test_a_force_update_fits_the_budget(predictor: str, most: int) -> None:
    """With authentication and acknowledgement."""
    channel = force_channel(predictor=predictor)
    (form,) = channel.forms
    levels, previous = (sum(each[: len(form.newest)], ()) for each in (TYPICAL, EARLIER))
    payload: PreviousSample | ModelParameters = PreviousSample(40, previous)
    if form.previous is None:
        payload = ModelParameters(bytes(6))
    update = Update(9, 0, levels, None if predictor == "zoh" else payload)
    layout = UpdateLayout(channel.forms)
    layout.check(update)
    assert layout.length(update) + PSK_TAG <= most
    assert layout.length(update, acknowledges=False) == layout.length(update) - 2
    assert Checksum().tag_size < PSK_TAG == 8


LEVELS = st.lists(LEVEL, min_size=6, max_size=6).map(tuple)
PAYLOADS = st.one_of(
    st.none(),
    st.builds(PreviousSample, st.integers(1, MAX_GAP), LEVELS),
    st.builds(ModelParameters, st.binary(max_size=MOST_PARAMETER_BYTES)),
)
UPDATES = st.builds(Update, st.integers(0, 2**16 - 1), st.integers(0, MAX_SELECTOR), LEVELS, PAYLOADS)
ACKS = st.lists(st.none() | st.integers(0, 2**16 - 1), min_size=2, max_size=2).map(tuple)
ENVELOPES = st.tuples(
    st.integers(0, 2**16 - 1), st.integers(0, 1), st.integers(0, 2**23 - 1), st.integers(0, 255), ACKS
)
CREDITS = st.none() | st.integers(0, 2**40)


@given(ENVELOPES, LEVEL, UPDATES, CREDITS, st.booleans())
def test_an_update_survives_the_wire(
    envelope: Envelope, lag: int, update: Update, credit: int | None, second: bool
) -> None:
    form = UpdateForm((3, 3), None if isinstance(update.payload, ModelParameters) else (3, 3))
    stream = (form,) * (MAX_SELECTOR + 1)
    direction = DirectionLayout([stream, stream], carries_credit=credit is not None, acks=2)
    layout = direction.updates[second]
    layout.check(update)
    data = layout.pack(envelope, lag, update, credit or 0)
    assert wire.kind_of(data) == (Kind.SECOND_UPDATE if second else Kind.UPDATE)
    assert wire.sequence_of(data) == envelope[0]
    head, content = direction.read(data[0], data[CLEAR_BYTES:])
    assert (head, content) == direction.read(data[0] | wire.PHASE, data[CLEAR_BYTES:])
    assert head == wire.Head(wire.kind_of(data), update.payload is not None, update.selector, *envelope[1:])
    assert head.is_encoding
    assert content == UpdateContent(lag, update.newest, update.payload, None if credit is None else credit % 2**16)
    assert wire.length_fault(data, direction.lengths(0)) is None


@given(
    ENVELOPES,
    st.integers(0, 2**16 - 1),
    st.none()
    | st.builds(
        Report,
        st.integers(-(2**47), 2**47 - 1),
        st.integers(0, 2**24 - 1),
        st.integers(0, 2**24 - 1),
        st.integers(0, 2**16 - 1),
        st.integers(0, 2**16 - 1),
        st.integers(0, 2**16 - 1),
    ),
    CREDITS,
    st.none() | st.integers(0, 2**16 - 1),
)
def test_a_heartbeat_survives_the_wire(
    envelope: Envelope, ticks: int, report: Report | None, credit: int | None, opening: int | None
) -> None:
    direction = DirectionLayout([forms(3)], carries_credit=credit is not None, acks=2)
    data = wire.pack_heartbeat(envelope, ticks, report, credit, round_trip_ms=opening)
    head, content = direction.read(data[0], data[CLEAR_BYTES:])
    assert content == HeartbeatContent(ticks, None if credit is None else credit % 2**32, report, opening)
    assert (head.generation, head.sent, head.echo, head.acks) == envelope[1:]
    assert not (head.asks or head.is_encoding)
    asking = wire.pack_heartbeat(envelope, ticks, report, credit, round_trip_ms=opening, asks=True, is_encoding=True)
    head, _ = direction.read(asking[0], asking[CLEAR_BYTES:])
    assert head.asks and head.is_encoding
    assert asking[1:] == data[1:]


def test_a_report_saturates() -> None:
    data = wire.pack_heartbeat((5, 0, 6, 7, (None,)), 0, Report(0, 2**40, 2**40, 0, 2**20, 7))
    _, content = DirectionLayout([forms(3)]).read(data[0], data[CLEAR_BYTES:])
    assert content == HeartbeatContent(0, None, Report(0, 2**24 - 1, 2**24 - 1, 0, 2**16 - 1, 7))


@given(ENVELOPES, st.text(), st.binary(min_size=1, max_size=300), st.integers(0, 2**32 - 1), st.integers(0, 7))
def test_other_kinds_survive_the_wire(envelope: Envelope, reason: str, body: bytes, tick: int, number: int) -> None:
    """A reason is cut at a character, a change at its limit."""
    direction = DirectionLayout([forms(3)], acks=2)
    said = direction.read((data := wire.pack_bye(envelope, reason))[0], data[CLEAR_BYTES:])[1]
    assert isinstance(said, ByeContent)
    assert len(said.reason.encode()) <= wire.LONGEST_REASON
    assert reason.encode(errors="replace").decode().startswith(said.reason)
    data = wire.pack_change(envelope, tick, number, body, is_answer=False)
    head, content = direction.read(data[0], data[CLEAR_BYTES:])
    assert (head.selector, content) == (number, ChangeContent(tick, body[: wire.LONGEST_CHANGE]))
    data = wire.pack_path(envelope, body[:8].ljust(8), is_answer=True)
    head, content = direction.read(data[0], data[CLEAR_BYTES:])
    assert (head.mark, content) == (True, PathContent(body[:8].ljust(8)))


@given(st.integers(0, 255), st.binary(max_size=120), st.booleans())
def test_any_bytes_are_read_or_refused_and_what_is_read_has_one_form(
    first: int, body: bytes, carries_credit: bool
) -> None:
    stream = (UpdateForm((3, 3), (3, 3)), UpdateForm((3,), (3,)), UpdateForm((3,), None))
    direction = DirectionLayout([stream], carries_credit=carries_credit)
    try:
        head, content = direction.read(first, body)
    except MalformedError:
        return
    if isinstance(content, UpdateContent):
        update = Update(0, head.selector, content.newest, content.payload)
        direction.updates[0].check(update)
        packed = direction.updates[0].pack(
            (0, head.sent, head.echo, head.acks), content.lag, update, content.credit or 0
        )
        assert len(packed) <= CLEAR_BYTES + len(body)
        assert direction.read(packed[0], packed[CLEAR_BYTES:]) == (head, content)


@pytest.mark.parametrize("harm", [lambda body: body[:-1], lambda body: body + b"\0", lambda body: body[:-1] + b"\xff"])
@pytest.mark.parametrize("payload", [None, PreviousSample(3, (1, 2, 4))])
def test_an_update_that_is_cut_or_goes_on_is_refused(payload: PreviousSample | None, harm: object) -> None:
    direction = DirectionLayout([forms(3)])
    data = direction.updates[0].pack((1, 0, 2, 3, (None,)), 0, Update(1, 0, (1, 2, 3), payload))
    direction.read(data[0], data[CLEAR_BYTES:])
    with pytest.raises(MalformedError):
        direction.read(data[0], harm(data[CLEAR_BYTES:]))  # type: ignore[operator]


@given(st.lists(st.one_of(LEVEL.map(lambda level: (level,)), LEVELS, st.integers(1, MAX_GAP)), max_size=6))
def test_groups_and_counts_come_back_and_take_the_bits_they_need(parts: list[tuple[int, ...] | int]) -> None:
    made, size = 1, 0
    for part in parts:
        if isinstance(part, int):
            made = strings.put_count(made, part)
            size += 4 + part.bit_length() - 1
        else:
            made = strings.put_group(made, part)
            size += 4 + len(part) * max(max(part).bit_length() + 1, (~min(part)).bit_length() + 1, 1)
    data = strings.to_bytes(made)
    assert len(data) <= -(-size // 8)
    number, left = int.from_bytes(data, "big"), 8 * len(data)
    read: list[tuple[int, ...] | int] = []
    for part in parts:
        if isinstance(part, int):
            count, left = strings.take_count(number, left)
            read.append(count)
        else:
            group, left = strings.take_group(number, left, len(part))
            read.append(group)
    assert read == parts
    strings.end(number, left)


@pytest.mark.parametrize("tag", [4, 8])
def test_each_shape_has_its_lengths_and_no_other(tag: int) -> None:
    limits = DirectionLayout([forms(3)]).lengths(tag)
    for first in range(256):
        low, high = limits.get(first & 0xF, (1, 0))
        for size in range(1, 120):
            fault = wire.length_fault(bytes((first,)) + bytes(size - 1), limits)
            if first & 0xF not in limits:
                assert fault is DropReason.UNKNOWN_KIND
            elif size < low:
                assert fault is DropReason.TRUNCATED
            else:
                assert fault is (DropReason.WRONG_LENGTH if size > high else None)
    assert set(range(16)) - set(limits) == {1, 2, 7, 9, 10, 13, 15}
