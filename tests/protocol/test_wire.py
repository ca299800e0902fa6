import re
from struct import calcsize

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.protocol.harness import KEY, forms
from weberlink.protocol import DropReason, wire
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import DirectionLayout, Kind, Report, UpdateLayout
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


def documented(values: int) -> dict[str, int]:
    """Bytes of each part, from the table of the module; formats and sizes of the table must agree with each other."""
    sizes: dict[str, int] = {}
    rows = re.findall(r"^\| (\w+) \| (\w+) \| ([\w-]+) \| ([\w-]+) \|", wire.__doc__ or "", re.MULTILINE)[1:]
    for part, _, form, size in rows:
        if part == "bye":
            assert size == f"0-{wire.LONGEST_REASON}"
            continue
        if (part, size) == ("change", f"1-{wire.LONGEST_CHANGE}"):
            continue
        stated = values * int(size[:-1]) if size.endswith("n") else int(size)
        assert calcsize("<" + re.sub(r"^n", str(values), form)) == stated
        sizes[part] = sizes.get(part, 0) + stated
    return sizes


@pytest.mark.parametrize("streams", [1, 2])
@pytest.mark.parametrize("carries_credit", [False, True])
@pytest.mark.parametrize("values", [1, 2, 3, 6])
def test_documented_sizes_are_those_of_the_code(values: int, carries_credit: bool, streams: int) -> None:
    sizes = documented(values)
    direction = DirectionLayout((forms(values),) * streams, carries_credit=carries_credit, further_acks=streams - 1)
    lengths = direction.lengths(0)
    levels, acks = tuple(range(values)), (7,) * (streams - 1)
    assert set(sizes) == {
        *("head", "update", "previous", "heartbeat", "update_credit", "heartbeat_credit", "second_ack"),
        *("change", "path"),
    }
    if not carries_credit:
        sizes["update_credit"] = sizes["heartbeat_credit"] = 0
    if streams == 1:
        sizes["second_ack"] = 0
    assert sizes["head"] == wire.HEAD_BYTES
    for layout in direction.updates:
        plain = layout.pack(1, 2, Update(9, 5, levels), 8, acks)
        assert len(plain) == sizes["head"] + sizes["update"] + sizes["update_credit"] + sizes["second_ack"]
        paired = layout.pack(1, 2, Update(9, 5, levels, PreviousSample(6, levels)), 8, acks)
        assert len(paired) == len(plain) + sizes["previous"]
        assert all(lengths[data[0] & 0xF] == (len(plain), len(paired)) for data in (plain, paired))
    heartbeat = wire.pack_heartbeat(
        1, 2, Report(0, 0, 0, 0), 9 if carries_credit else None, further_acks=(7,) * (streams - 1)
    )
    assert len(heartbeat) == sum(sizes[part] for part in ("head", "heartbeat", "heartbeat_credit", "second_ack"))
    assert lengths[heartbeat[0] & 0xF] == (len(heartbeat), len(heartbeat))
    assert len(wire.pack_bye(1, 2, "x" * 100)) == sizes["head"] + wire.LONGEST_REASON
    changed = wire.pack_change(1, 2, 3, 4, b"x" * 300, is_answer=True)
    assert len(changed) == sizes["head"] + sizes["change"] + wire.LONGEST_CHANGE == lengths[changed[0] & 0xF][1]
    path = wire.pack_path(1, 2, bytes(wire.TOKEN_BYTES), is_answer=True)
    assert (len(path),) * 2 == (sizes["head"] + sizes["path"],) * 2 == lengths[path[0] & 0xF]


@pytest.mark.parametrize(
    ("streams", "carries_credit", "plain", "paired"), [(1, False, 32, 46), (1, True, 34, 48), (2, False, 34, 48)]
)
def test_three_axis_update_fits_the_budget(streams: int, carries_credit: bool, plain: int, paired: int) -> None:
    """A force is not made longer by a torque; what ends its datagram is the acknowledgement of the other stream."""
    acks = (1,) * (streams - 1)
    for layout in DirectionLayout((forms(6),) * streams, carries_credit=carries_credit, further_acks=len(acks)).updates:
        assert len(layout.pack(1, 2, Update(9, 5, (1,) * 6), 0, acks)) + PSK_TAG == plain
        assert len(layout.pack(1, 2, Update(9, 5, (1,) * 6, PreviousSample(6, (1,) * 6)), 0, acks)) + PSK_TAG == paired


def test_one_axis_takes_24_bytes() -> None:
    assert len(UpdateLayout(forms(2)).pack(1, 2, Update(9, 5, (1, 2)))) + PSK_TAG == 24
    assert Checksum().tag_size < PSK_TAG


LEVELS = st.lists(LEVEL, min_size=6, max_size=6).map(tuple)
PAYLOADS = st.one_of(
    st.none(),
    st.builds(PreviousSample, st.integers(1, MAX_GAP), LEVELS),
    st.builds(ModelParameters, st.binary(max_size=MOST_PARAMETER_BYTES)),
)
UPDATES = st.builds(Update, st.integers(0, 2**16 - 1), st.integers(0, MAX_SELECTOR), LEVELS, PAYLOADS)


@given(
    st.integers(0, 2**24 - 1),
    st.integers(0, 2**16 - 1),
    st.integers(0, 2**24 - 1),
    st.integers(0, 255),
    UPDATES,
    st.one_of(st.none(), st.integers(0, 2**40)),
)
def test_an_update_survives_the_wire(
    sequence: int, ack: int, sent: int, echo: int, update: Update, credit: int | None
) -> None:
    previous = None if isinstance(update.payload, ModelParameters) else (3, 3)
    form = (UpdateForm((3, 3), previous),) * (MAX_SELECTOR + 1)
    direction = DirectionLayout([form], carries_credit=credit is not None)
    (layout,) = direction.updates
    layout.check(update)
    data = layout.pack(sequence, wire.pack_word(ack, sent, echo, update.tick), update, credit or 0)
    body = data[wire.CLEAR_BYTES :]
    assert wire.kind_of(data) == Kind.UPDATE
    assert wire.sequence_of(data) == sequence
    head = wire.read_head(data[0], body)
    assert head == wire.read_head(data[0] | wire.PHASE, body)
    assert head == wire.Head(Kind.UPDATE, update.payload is not None, update.selector, ack, sent, update.tick, echo)
    assert head.is_encoding
    assert layout.unpack(body, head, update.tick) == update
    assert wire.length_fault(data, direction.lengths(0)) is None
    if credit is not None:
        assert direction.read_credit(Kind.UPDATE, body) == (credit % 2**16, 16)


@given(
    st.integers(-(2**63), 2**63 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**16 - 1),
    st.one_of(st.none(), st.integers(0, 2**40)),
)
def test_a_report_survives_the_wire(minimum: int, latest: int, late: int, loss: int, credit: int | None) -> None:
    report = Report(minimum, latest, late, loss)
    word = wire.pack_word(6, 7, 8)
    data = wire.pack_heartbeat(5, word, report, credit)
    if credit is not None:
        direction = DirectionLayout([forms(6)], carries_credit=True)
        assert direction.read_credit(Kind.HEARTBEAT, data[wire.CLEAR_BYTES :]) == (credit % 2**32, 32)
    assert wire.unpack_report(data[wire.CLEAR_BYTES :]) == report
    head = wire.read_head(data[0], data[wire.CLEAR_BYTES :])
    assert head == wire.Head(Kind.HEARTBEAT, False, 0, 6, 7, 0, 8)
    assert not (head.asks or head.is_encoding)
    asking = wire.pack_heartbeat(5, word, report, credit, asks=True, is_encoding=True)
    head = wire.read_head(asking[0], asking[wire.CLEAR_BYTES :])
    assert head.asks and head.is_encoding
    assert asking[1:] == data[1:]


def test_a_report_saturates() -> None:
    data = wire.pack_heartbeat(5, 6, Report(0, 2**40, 2**40, 0))
    assert wire.unpack_report(data[wire.CLEAR_BYTES :]) == Report(0, 2**32 - 1, 2**32 - 1, 0)


@given(st.text())
def test_a_reason_is_cut_at_a_character(reason: str) -> None:
    data = wire.pack_bye(5, 6, reason)
    said = wire.unpack_bye(data[wire.CLEAR_BYTES :])
    assert len(said.encode()) <= wire.LONGEST_REASON
    assert reason.encode(errors="replace").decode().startswith(said)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"\x03" + bytes(25), None),
        (b"\x03" + bytes(24), DropReason.TRUNCATED),
        (b"\x03" + bytes(34), DropReason.WRONG_LENGTH),
        (b"\x0b" + bytes(33), None),
        (b"\x0b" + bytes(24), DropReason.TRUNCATED),
        (b"\xfb" + bytes(33), None),
        (b"\x04" + bytes(37), None),
        (b"\x05" + bytes(19), None),
        (b"\x05" + bytes(83), None),
        (b"\x05" + bytes(84), DropReason.WRONG_LENGTH),
        (b"\x0c" + bytes(37), None),
        (b"\x0d" + bytes(19), DropReason.UNKNOWN_KIND),
        (b"\x00" + bytes(27), None),
        (b"\x08" + bytes(27), None),
        (b"\x00" + bytes(28), DropReason.WRONG_LENGTH),
        (b"\x0a" + bytes(37), DropReason.UNKNOWN_KIND),
    ],
)
def test_each_shape_has_its_length(data: bytes, fault: DropReason | None) -> None:
    assert wire.length_fault(data, DirectionLayout([forms(3)]).lengths(8)) is fault
