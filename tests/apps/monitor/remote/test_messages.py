"""Messages of the telemetry link: round trip and limits."""

import json
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.monitor.feeds import description, records
from weberlink.apps.monitor.remote.messages import (
    LONGEST_BEGIN,
    RECORDS_AT_ONCE,
    RecordBlock,
    SideIntroduction,
    pack_end,
    pack_introduction,
    pack_records,
    read_end,
    read_introduction,
    read_records,
)
from weberlink.protocol.sealed_stream import LONGEST_PAYLOAD, StreamError

BEGIN = SideIntroduction("7", "slave", 1000.0, 12.5, description("slave"))


def test_introduction_round_trip() -> None:
    assert read_introduction(pack_introduction(BEGIN)) == BEGIN
    assert read_introduction(pack_introduction(BEGIN._replace(description=None))).description is None


def test_too_long_description_is_omitted() -> None:
    noise = np.random.default_rng(1).bytes(LONGEST_PAYLOAD).hex()
    packed = pack_introduction(BEGIN._replace(description={"scene": noise}))
    assert len(packed) <= LONGEST_PAYLOAD
    assert read_introduction(packed) == BEGIN._replace(description=None)


@pytest.mark.parametrize(
    "change",
    [
        {"session": 7},
        {"side": "other"},
        {"rate_hz": 0.0},
        {"rate_hz": float("nan")},
        {"rate_hz": True},
        {"began": 1e300},
        {"began": "now"},
        {"description": []},
        {"description": {"weber": float("inf")}},
        {"description": {"bank": json.loads("[" * 200 + "]" * 200)}},
        {"more": 1},
    ],
)
def test_implausible_introduction_is_refused(change: dict[str, object]) -> None:
    packed = zlib.compress(json.dumps(BEGIN._asdict() | change).encode())
    with pytest.raises(StreamError):
        read_introduction(packed)


def test_decompressed_size_is_limited() -> None:
    with pytest.raises(StreamError, match="longer"):
        read_introduction(zlib.compress(b" " * (LONGEST_BEGIN + 1)))
    head = pack_records(RecordBlock("slave", 0, 0, records(0)))[:17]
    with pytest.raises(StreamError, match="longer"):
        read_records(head + zlib.compress(bytes((RECORDS_AT_ONCE + 1) * records(1).itemsize)))


def test_records_round_trip_and_fit_into_a_message() -> None:
    made = np.frombuffer(np.random.default_rng(1).bytes(RECORDS_AT_ONCE * records(1).itemsize), records(0).dtype)
    packed = pack_records(RecordBlock("master", 5, 2, made))
    assert len(packed) <= LONGEST_PAYLOAD
    piece = read_records(packed)
    assert (piece.side, piece.written, piece.lost) == ("master", 5, 2)
    assert piece.records.tobytes() == made.tobytes()


def test_end_round_trip() -> None:
    assert [read_end(pack_end(side)) for side in ("master", "slave")] == ["master", "slave"]


@given(st.binary(max_size=300))
def test_noise_raises_only_stream_errors(noise: bytes) -> None:
    for read in (read_introduction, read_records, read_end):
        for data in (noise, zlib.compress(noise), pack_records(RecordBlock("slave", 0, 0, records(0)))[:17] + noise):
            try:
                read(data)
            except StreamError:
                continue
