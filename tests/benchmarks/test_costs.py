"""Percentiles, the meter, and the cost of a tick and of the codec."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.arrangement import Arrangement
from benchmarks.codec_speed import measure as measure_codec
from benchmarks.meter import Account, Meter, Overhead, metered
from benchmarks.percentiles import NAMES, PERCENTILES, percentile, ratio, ratios, summary
from benchmarks.tick_cost import CHUNK, PARTS, QUICK_TICKS, assemble, measure
from tests.system.systems import CONFIGS
from weberlink.protocol.keys import generate
from weberlink.protocol.psk import CcmProtection
from weberlink.system.configuration import SIDES

DURATIONS = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50)


@given(values=DURATIONS, p=st.sampled_from([*PERCENTILES.values(), 0.1, 33.0, 100.0]))
def test_percentiles_are_nearest_rank(values: list[float], p: float) -> None:
    ordered = sorted(values)
    enough = [value for value in ordered if sum(each <= value for each in ordered) * 100.0 >= p * len(ordered) - 1e-6]
    assert percentile(np.array(ordered), p) == enough[0]


def test_rounding_moves_no_rank() -> None:
    assert percentile(np.arange(1.0, 751.0), 4.4) == 33.0
    assert percentile(np.arange(1.0, 1001.0), 99.9) == 999.0


def test_a_summary_needs_no_order() -> None:
    values = np.random.default_rng(1).permutation(np.arange(1.0, 10_001.0))
    assert summary(values) == {"p50": 5000.0, "p90": 9000.0, "p99": 9900.0, "p99_9": 9990.0, "max": 10_000.0}


def test_a_ratio_is_to_the_limit() -> None:
    assert ratio(3.0, 2.0) == pytest.approx(1.5)
    assert ratio(3.0, 0.0) is None
    assert ratio(3.0, None) is None
    assert ratios(summary([4.0]), summary([2.0])) == dict.fromkeys(NAMES, 2.0)


class Clock:
    """Time that passes only when somebody works."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> int:
        return self.now

    def work(self, ns: int) -> None:
        self.now += ns


class Inner:
    def __init__(self, clock: Clock) -> None:
        self.clock = clock

    def run(self, ns: int) -> str:
        self.clock.work(ns)
        return "done"

    def fail(self) -> None:
        self.clock.work(5)
        raise KeyError("inner")

    @property
    def shown(self) -> int:
        self.clock.work(3)
        return 3

    @staticmethod
    def free() -> int:
        return 1


class Derived(Inner):
    def more(self) -> None:
        self.run(7)
        self._hidden()

    def _hidden(self) -> None:
        self.clock.work(2)


class Outer:
    def __init__(self, clock: Clock, inner: Inner) -> None:
        self.clock = clock
        self.inner = inner
        self.bound: Callable[[int], str] = inner.run

    def run(self) -> str:
        self.clock.work(10)
        said = self.inner.run(20)
        self.clock.work(30)
        return said

    def run_bound(self) -> None:
        self.bound(4)

    def catch(self) -> None:
        self.clock.work(1)
        with pytest.raises(KeyError):
            self.inner.fail()
        self.clock.work(2)


TIMED: dict[type, str] = {Inner: "inner", Outer: "outer"}


def test_nested_calls_do_not_count_for_the_caller() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, TIMED):
        outer = Outer(clock, Inner(clock))
        with meter.charging(account, "rest"):
            clock.work(100)
            assert outer.run() == "done"
            clock.work(200)
    assert dict(account.spent) == {"rest": 300, "outer": 40, "inner": 20}
    assert dict(account.calls) == {"outer": 1, "inner": 1}
    assert dict(account.nested) == {"rest": 1, "outer": 1}


def test_bound_methods_are_timed() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, TIMED):
        outer = Outer(clock, Inner(clock))
        with meter.charging(account, "rest"):
            outer.run_bound()
    assert account.spent["inner"] == 4
    assert account.spent["outer"] == 0


def test_exceptions_pass_and_are_timed() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, TIMED):
        outer = Outer(clock, Inner(clock))
        with meter.charging(account, "rest"):
            outer.catch()
            clock.work(50)
    assert dict(account.spent) == {"rest": 50, "outer": 3, "inner": 5}


def test_properties_count_for_the_caller() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, {Derived: "derived"}):
        derived = Derived(clock)
        with meter.charging(account, "rest"):
            assert derived.shown == 3
            assert derived.free() == 1
            derived.more()
    assert dict(account.spent) == {"rest": 3, "derived": 9}
    assert account.calls["derived"] == 2  # `more`, and the inherited `run` in it


def test_classes_are_restored_after_a_failure() -> None:
    before: dict[type, dict[str, Any]] = {kind: dict(vars(kind)) for kind in (Inner, Outer, Derived)}
    with pytest.raises(KeyError), metered(Meter(), {Inner: "inner", Outer: "outer", Derived: "derived"}):
        assert Inner.run is not before[Inner]["run"]
        assert "run" in vars(Derived)
        raise KeyError
    assert {kind: dict(vars(kind)) for kind in before} == before
    assert "run" not in vars(Derived)


def test_the_cost_of_timing_is_subtracted() -> None:
    account = Account({"a": 1000.0, "b": 500.0, "c": 3.0}, {"b": 10, "c": 1}, {"a": 10, "b": 1})
    overhead = Overhead(inside=20.0, outside=30.0)
    assert overhead.corrected(account) == {"a": 700.0, "b": 270.0, "c": 0.0}
    assert overhead.cost(account) == 11 * 20.0 + 11 * 30.0


def chunk(calls: int, **spent_us: float) -> Account:
    """Of `CHUNK` ticks, each with so many timed calls from `rest` to the codec."""
    nested = {"rest": calls * CHUNK} if calls else {}
    return Account({part: us * 1e3 * CHUNK for part, us in spent_us.items()}, {"codec": calls * CHUNK}, nested)


def test_the_parts_add_up_to_an_unmetered_tick() -> None:
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


def test_every_part_of_both_sides_is_measured(tmp_path: Path) -> None:
    key = tmp_path / "key"
    generate(key)
    seal = CcmProtection.seal
    arrangement = Arrangement(CONFIGS / "loopback.yaml", key, ("control.scheme=tdpa",), lambda _: [], quick=True)
    cost = measure(arrangement)
    assert CcmProtection.seal is seal
    assert cost.ticks == QUICK_TICKS
    for side in SIDES:
        assert tuple(cost.parts_us[side]) == PARTS
        for part in ("device", "codec", "protocol", "socket", "telemetry", "rest"):
            assert cost.parts_us[side][part] > 0.0, part
        assert cost.unmetered_us[side] > 0.0
    assert any(cost.parts_us[side]["security"] > 0.0 for side in SIDES)


def test_the_codec_codes_the_whole_recording() -> None:
    document = measure_codec(quick=True).as_json()
    assert document["live_samples_per_s"] > 0.0
    assert document["samples"] > 1000
