"""The figures of a session, on records made by hand."""

from collections.abc import Iterator
from itertools import zip_longest
from math import pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from tests.records import ticks
from weberlink.control.contract import AccountParameters
from weberlink.protocol.states import State
from weberlink.telemetry.reader import DTYPE, Records
from weberlink.telemetry.record import COUNTERS, FIELDS
from weberlink_figures.session import Layout, SessionScore, nearest_ticks
from weberlink_figures.tree import Figures

RATE = 1000.0
NONE = np.empty(0, DTYPE)
NO_BOUND = dict.fromkeys(("bound_j", "bound_share"))  # of one side alone, without an account


def records(count: int, *, phase: float = 0.0, **columns: Any) -> Records:
    usual = {"tick": np.arange(count), "state": State.ENGAGED.value, "rtt_us": np.nan, "one_way_us": np.nan}
    return ticks(count, start=10.0 + phase, **usual | columns)


def figures(master: Records, slave: Records, pieces: int = 1, **layout: Any) -> Figures:
    scored = SessionScore(Layout.hand(RATE, ("zoh", "plane"), **layout))
    for one, other in zip(np.array_split(master, pieces), np.array_split(slave, pieces), strict=True):
        scored.add(one, other)
    return scored.figures()


def score(master: Records, slave: Records, pieces: int = 1, **layout: Any) -> Any:
    return figures(master, slave, pieces, **layout).to_json()


@examples(50)
@given(st.integers(1, 60), st.integers(1, 60), st.floats(-3.0, 3.0), st.integers(0, 2**32 - 1))
def test_the_nearest_tick_is_that_of_an_exhaustive_search(ticks: int, others: int, phase: float, seed: int) -> None:
    chance = np.random.default_rng(seed)
    master, slave = (np.sort(np.arange(n) + chance.uniform(-0.3, 0.3, n)) for n in (ticks, others))
    slave += phase
    ready, nearest, close = nearest_ticks(master, slave, 1.0)
    assert (slave[:ready] <= master[-1] - 0.5).all()
    assert ready == others or slave[ready] > master[-1] - 0.5
    distances = np.abs(slave[:ready, None] - master)
    assert np.abs(slave[:ready] - master[nearest]) == pytest.approx(distances.min(axis=1))
    assert close.tolist() == (distances.min(axis=1) <= 0.75).tolist()


def arbitrary(chance: np.random.Generator, ticks: int) -> Records:
    """Records of a side that misses ticks, at 100 Hz; states last up to 4 s."""
    made = np.zeros(ticks, DTYPE)
    for field in FIELDS:
        values = chance.normal(size=made[field.name].shape)
        made[field.name] = values if field.axes > 1 else values > 0.5 if field.kind == "u1" else np.abs(values)
    for name in COUNTERS:
        made[name] = np.cumsum(chance.integers(0, 2, ticks))
    made["tick"] = np.arange(ticks) + made["ticks_missed"]
    made["at"] = 10.0 + (made["tick"] + chance.uniform(-0.2, 0.2)) / 100.0
    states = chance.choice([each.value for each in State], ticks)
    made["state"] = np.repeat(states, chance.integers(1, 400, ticks))[:ticks]
    return made


def leaves(tree: Any) -> Iterator[Any]:
    for each in tree.values():
        yield from leaves(each) if isinstance(each, dict) else [each]


@examples(25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 1000), st.integers(1, 20), st.integers(1, 20))
def test_the_figures_do_not_depend_on_the_pieces(seed: int, ticks: int, pieces: int, others: int) -> None:
    chance = np.random.default_rng(seed)  # no piece is longer than records wait for their counterpart
    sides = arbitrary(chance, ticks), arbitrary(chance, ticks)
    account = AccountParameters(allowance=0.02, refill=0.01, damping=1.0, rise=160.0)
    whole, parts = (
        SessionScore(Layout.hand(100.0, ("zoh", "plane"), ("zoh", "linear"), accounts=(account, account)))
        for _ in range(2)
    )
    whole.add(*sides)
    for split in zip_longest(np.array_split(sides[0], pieces), np.array_split(sides[1], others), fillvalue=NONE):
        parts.add(*split)
    for found, expected in zip(*(leaves(each.figures().to_json()) for each in (parts, whole)), strict=True):
        assert found == expected or found == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_reduction_counts_updates_and_datagrams_per_engaged_tick() -> None:
    sent = {"updates_sent": np.linspace(0, 50, 1000), "datagrams_sent": np.linspace(0, 70, 1000)}
    slave = records(1000, selected=[1, 0] * 500, sent=np.arange(1000) < 10, **sent)
    force = score(records(1000), slave)["force"]
    assert force["packets"] == 50
    assert force["reduction"] == pytest.approx(0.95)
    assert force["reduction_all"] == pytest.approx(0.93)
    assert force["selected"] == {"zoh": 5, "plane": 5}


@examples(50)
@given(st.lists(st.sampled_from([np.nan, 0.0, 300.0, 3000.0, 20e3, 60e3]), min_size=1, max_size=5), st.data())
def test_delay_explains_the_ticks_with_an_update_on_its_way_whatever_it_was_before(
    delays_us: list[float], data: st.DataObject
) -> None:
    """Against a search of every tick; the delay changes while the session runs."""
    ticks = 400
    sends = data.draw(st.lists(st.integers(0, ticks - 2), max_size=20, unique=True))
    one_way = np.repeat(delays_us, -(-ticks // len(delays_us)))[:ticks]
    sent = np.isin(np.arange(ticks), sends)
    master = records(ticks, one_way_us=one_way, ramping=np.arange(ticks) < 50)
    slave = records(ticks, sent=sent, updates_sent=np.cumsum(sent))
    delayed = [1 if np.isnan(us) else max(1, round(us / 1e3)) for us in master["one_way_us"].tolist()]
    on_its_way = [any(0 <= tick - sent < delayed[tick] for sent in sends) for tick in range(50, ticks - 1)]
    floor = score(master, slave, data.draw(st.integers(1, 7)))["force"]["violation_floor"]
    assert floor == pytest.approx(sum(on_its_way) / len(on_its_way))


def test_violations_and_errors_in_units_of_the_bound() -> None:
    master = records(1000, phase=0.2e-3, ramping=np.arange(1000) >= 890)  # what ramps does not count
    slave = records(1000, bound=0.25, raw=(0.0, 0.0, 0.1))
    slave["raw"][500, 2] = 0.25  # on the bound, not outside
    slave["raw"][300:420, 2] = 0.5
    slave["raw"][700, 2] = 0.7
    slave["raw"][900:, 2] = 9.0
    force = score(master, slave, pieces=10)["force"]
    assert force["violation_longest_s"] == pytest.approx(0.12)
    assert force["violation_s"] == pytest.approx(0.121)
    assert force["error_max_deadbands"] == pytest.approx(2.8)
    assert force["error_p99_deadbands"] == pytest.approx(2.0, rel=0.01)


def test_the_master_alone_has_no_felt_error() -> None:
    summary = score(records(100), NONE)
    assert summary["ticks"]["master"]["count"] == 100
    assert summary["ticks"]["slave"]["lateness_us"]["p50"] is None
    assert {summary["force"][key] for key in ("error_rms", "error_max_deadbands", "violation_longest_s")} == {None}
    assert summary["energy"] == {"generated_j": 0.0, "dissipated_j": 0.0} | NO_BOUND


def test_the_slave_alone_has_no_energy() -> None:
    force, tick = (0.0, 0.0, 2.0), np.arange(100)
    slave = records(100, raw=force, coded=force, bound=0.2, ramping=tick < 10, second_updates_received=tick // 10)
    slave["decoded"][10:, 2] = 1.9
    summary = score(NONE, slave, torque_bank=("zoh",))
    assert summary["force"]["coding"]["error_max"] == pytest.approx(0.1)
    assert summary["force"]["coding"]["violation_fraction"] == 0.0
    assert summary["orientation"]["packets"] == 9
    assert summary["energy"] == {"generated_j": None, "dissipated_j": None} | NO_BOUND


def test_generated_energy_is_the_most_that_was_missing() -> None:
    """1 mJ in, 3 mJ out, 6 mJ in: at most 2 mJ are missing, and 4 mJ remain. Lost records count nothing."""
    master, slave = records(3001), records(3001)
    way = np.concatenate(
        [np.linspace(0.0, 0.01, 1001), np.linspace(0.01, 0.0, 1001)[1:], np.linspace(0.0, 0.01, 1001)[1:]]
    )
    master["position"][:, 2] = slave["output"][:, 2] = way
    master["output"][:1000, 2], master["output"][1000:2000, 2], master["output"][2000:, 2] = -0.1, -0.3, -0.6
    energy = score(master, slave)["energy"]
    assert energy["generated_j"] == pytest.approx(0.002)
    assert energy["dissipated_j"] == pytest.approx(0.004)
    missing = score(np.delete(master, slice(500, 600)), slave)["energy"]
    assert missing["dissipated_j"] == pytest.approx(0.004 - 101 * 1e-6)


def test_torque_and_orientation_have_their_figures() -> None:
    tick, torque, turn = np.arange(1000), (*[0.0] * 3, 0.2), (*[0.0] * 5, pi + 0.01)
    master = records(1000, output=(*[0.0] * 3, 0.23), raw=turn, second_bound=0.02, second_updates_sent=tick // 100)
    slave = records(
        1000, raw=torque, coded=torque, decoded=(*[0.0] * 3, 0.21), second_bound=0.025,
        second_updates_sent=tick // 20, second_selected=[1, 0] * 500, second_sent=tick < 10,
        output=(*[0.0] * 5, -(pi - 0.02)),  # 0.01 rad apart
    )  # fmt: skip
    summary = score(master, slave, 7, torque_bank=("zoh", "linear"))
    torque, orientation = summary["torque"], summary["orientation"]
    assert torque["error_rms"] == pytest.approx(0.03, rel=1e-5)
    assert torque["violation_fraction"] == 1.0
    assert torque["error_max_deadbands"] == pytest.approx(1.2, rel=1e-3)
    assert torque["coding"]["error_rms"] == pytest.approx(0.01, rel=1e-5)
    assert torque["coding"]["violation_fraction"] == 0.0
    assert (torque["packets"], orientation["packets"]) == (49, 9)
    assert torque["reduction"] == pytest.approx(0.951)
    assert torque["selected"] == {"zoh": 5, "linear": 5}
    assert orientation["error_max"] == pytest.approx(0.01, rel=1e-4)
    assert orientation["violation_fraction"] == 0.0
