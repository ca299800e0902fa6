"""Where time goes: nested calls, exceptions, what timing costs, and classes that are themselves again."""

from collections.abc import Callable
from typing import Any

import pytest

from benchmarks.meter import OUTSIDE, Account, Meter, Overhead, calibrate, metered


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


PARTS: dict[type, str] = {Inner: "inner", Outer: "outer"}


def test_a_nested_call_is_taken_out_of_what_calls_it() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, PARTS):
        outer = Outer(clock, Inner(clock))
        with meter.charging(account, "rest"):
            clock.work(100)
            assert outer.run() == "done"
            clock.work(200)
    assert dict(account.spent) == {"rest": 300, "outer": 40, "inner": 20}
    assert dict(account.calls) == {"outer": 1, "inner": 1}
    assert dict(account.nested) == {"rest": 1, "outer": 1}


def test_what_a_constructor_has_bound_is_timed_too() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, PARTS):
        outer = Outer(clock, Inner(clock))
        with meter.charging(account, "rest"):
            outer.run_bound()
    assert account.spent["inner"] == 4
    assert account.spent["outer"] == 0


def test_an_exception_passes_and_its_time_is_booked() -> None:
    clock, account = Clock(), Account()
    meter = Meter(clock)
    with metered(meter, PARTS):
        outer = Outer(clock, Inner(clock))
        with meter.charging(account, "rest"):
            outer.catch()
            clock.work(50)
    assert dict(account.spent) == {"rest": 50, "outer": 3, "inner": 5}


def test_properties_and_private_methods_count_for_who_uses_them() -> None:
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


def test_each_block_has_its_account_and_the_one_before_comes_back() -> None:
    clock, first, second = Clock(), Account(), Account()
    meter = Meter(clock)
    with meter.charging(first, "a"):
        clock.work(1)
        with meter.charging(second, "b"):
            clock.work(10)
        clock.work(2)
    clock.work(1000)  # nobody's
    assert dict(first.spent) == {"a": 3}
    assert dict(second.spent) == {"b": 10}


def test_classes_are_themselves_again_also_after_a_failure() -> None:
    before: dict[type, dict[str, Any]] = {kind: dict(vars(kind)) for kind in (Inner, Outer, Derived)}
    with pytest.raises(KeyError), metered(Meter(), {Inner: "inner", Outer: "outer", Derived: "derived"}):
        assert Inner.run is not before[Inner]["run"]
        assert "run" in vars(Derived)
        raise KeyError
    assert {kind: dict(vars(kind)) for kind in before} == before
    assert "run" not in vars(Derived)


def test_the_cost_of_timing_is_taken_out_where_it_falls() -> None:
    account = Account({"a": 1000.0, "b": 500.0, "c": 3.0}, {"b": 10, "c": 1}, {"a": 10, "b": 1})
    overhead = Overhead(inside=20.0, outside=30.0)
    assert overhead.corrected(account) == {"a": 700.0, "b": 270.0, "c": 0.0}
    assert overhead.cost(account) == 11 * 20.0 + 11 * 30.0


def test_others_on_the_processor_are_taken_out_of_all_parts_alike() -> None:
    scaled = Account({"a": 100.0, "b": 10.0}, {"b": 3}, {"a": 3}).scaled(0.5)
    assert scaled.spent == {"a": 50.0, "b": 5.0}
    assert scaled.calls == {"b": 3}


def test_calibration_finds_a_cost_on_both_sides() -> None:
    overhead = calibrate(rounds=5, calls=200)
    assert overhead.inside > 0.0
    assert overhead.outside > 0.0


def test_outside_of_every_block_nothing_is_lost_and_nothing_breaks() -> None:
    clock = Clock()
    meter = Meter(clock)
    timed = meter.timed("part", lambda: clock.work(5))
    timed()
    assert OUTSIDE != "part"
