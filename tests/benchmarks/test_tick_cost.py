"""The cost of a tick by part: its arithmetic, and both sides really run."""

from pathlib import Path

import pytest

from benchmarks.arrangement import Arrangement
from benchmarks.meter import Account, Overhead
from benchmarks.tick_cost import CHUNK, PARTS, QUICK_TICKS, assemble, measure
from tests.system.systems import CONFIGS
from weberlink.protocol.keys import generate
from weberlink.protocol.psk import CcmCipher
from weberlink.system.configuration import SIDES


def chunk(calls: int, **spent_us: float) -> Account:
    """Of `CHUNK` ticks, each with so many timed calls from `rest` to the codec."""
    nested = {"rest": calls * CHUNK} if calls else {}
    return Account({part: us * 1e3 * CHUNK for part, us in spent_us.items()}, {"codec": calls * CHUNK}, nested)


def test_the_parts_together_cost_what_a_tick_does_without_a_meter() -> None:
    empty = Overhead(inside=100.0, outside=300.0)
    bare = {side: [chunk(0, rest=20.0)] * 3 for side in SIDES}
    # Ten calls whose timing cost twice what it does in a loop of empty ones: 2 us in the codec, 6 us in the rest.
    timed = {side: [chunk(10, codec=7.0, rest=21.0)] * 3 for side in SIDES}
    cost = assemble(bare, timed, empty, 3 * CHUNK)
    for side in SIDES:
        assert cost.parts_us[side]["codec"] == pytest.approx(5.0)
        assert cost.parts_us[side]["rest"] == pytest.approx(15.0)
        assert cost.total_us(side) == pytest.approx(cost.unmetered_us[side]) == pytest.approx(20.0)
    assert cost.as_json()["timing_us"] == pytest.approx({"inside": 0.2, "outside": 0.6})


def test_one_disturbed_chunk_changes_nothing() -> None:
    empty = Overhead(inside=100.0, outside=300.0)
    bare = {side: [chunk(0, rest=20.0), chunk(0, rest=900.0), chunk(0, rest=20.0)] for side in SIDES}
    timed = {side: [chunk(10, codec=6.0, rest=18.0)] * 3 for side in SIDES}
    assert assemble(bare, timed, empty, 3 * CHUNK).unmetered_us["master"] == pytest.approx(20.0)


def test_a_meter_that_seems_to_cost_less_than_nothing_is_left_as_it_is() -> None:
    bare = {side: [chunk(0, rest=50.0)] for side in SIDES}
    timed = {side: [chunk(10, codec=6.0, rest=18.0)] for side in SIDES}
    cost = assemble(bare, timed, Overhead(100.0, 300.0), CHUNK)
    assert cost.parts_us["slave"]["codec"] == pytest.approx(6.0)


def test_both_sides_run_and_every_part_is_seen(tmp_path: Path) -> None:
    key = tmp_path / "key"
    generate(key)
    seal = CcmCipher.seal
    arrangement = Arrangement(CONFIGS / "loopback.yaml", key, ("control.scheme=tdpa",), lambda _: [], quick=True)
    cost = measure(arrangement)
    assert CcmCipher.seal is seal
    assert cost.ticks == QUICK_TICKS
    for side in SIDES:
        assert tuple(cost.parts_us[side]) == PARTS
        for part in ("device", "codec", "protocol", "socket", "telemetry", "rest"):
            assert cost.parts_us[side][part] > 0.0, part
        assert cost.unmetered_us[side] > 0.0
    assert any(cost.parts_us[side]["security"] > 0.0 for side in SIDES)
