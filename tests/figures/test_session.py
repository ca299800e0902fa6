"""The figures of a session, on records made by hand."""

from math import pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.figures.session import Layout, Records, SessionScore, nearest_ticks
from weberlink.protocol.states import State
from weberlink.telemetry.reader import DTYPE

RATE = 1000.0
NONE = np.empty(0, DTYPE)
NO_BOUND = dict.fromkeys(("bound_j", "bound_share"))
"""Of one side alone, without an account."""


def records(ticks: int, *, phase: float = 0.0) -> Records:
    made = np.zeros(ticks, DTYPE)
    made["tick"] = np.arange(ticks)
    made["at"] = 10.0 + phase + np.arange(ticks) / RATE
    made["state"] = State.ENGAGED.value
    made["rtt_us"] = made["one_way_us"] = np.nan
    return made


def score(master: Records, slave: Records, pieces: int = 1, torque_bank: tuple[str, ...] | None = None) -> Any:
    scored = SessionScore(Layout(RATE, ("zoh", "plane"), torque_bank))
    for one, other in zip(np.array_split(master, pieces), np.array_split(slave, pieces), strict=True):
        scored.add(one, other)
    return scored.figures().to_json()


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


def test_the_figures_do_not_depend_on_the_pieces() -> None:
    rng = np.random.default_rng(1)
    master, slave = records(3000, phase=0.4e-3), records(3000)
    for side in (master, slave):
        for name in ("position", "raw", "output", "decoded"):
            side[name] = rng.normal(size=(3000, 3))
        side["bound"] = 1.5
    whole, pieces = score(master, slave), score(master, slave, pieces=37)
    for channel in ("force", "position"):
        for key in ("error_rms", "error_max", "violation_fraction"):
            assert pieces[channel][key] == pytest.approx(whole[channel][key], rel=2e-3)
    assert pieces["energy"]["dissipated_j"] == pytest.approx(whole["energy"]["dissipated_j"], rel=1e-2, abs=0.1)


def test_reduction_counts_updates_and_datagrams_per_engaged_tick() -> None:
    master, slave = records(1000), records(1000)
    slave["updates_sent"] = np.linspace(0, 50, 1000).astype(int)
    slave["datagrams_sent"] = np.linspace(0, 70, 1000).astype(int)
    slave["selected"][::2] = 1
    slave["sent"][:10] = 1
    force = score(master, slave)["force"]
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
    master, slave = records(ticks), records(ticks)
    master["one_way_us"] = np.repeat(delays_us, -(-ticks // len(delays_us)))[:ticks]
    sends = data.draw(st.lists(st.integers(0, ticks - 2), max_size=20, unique=True))
    slave["sent"][sends] = 1
    slave["updates_sent"] = np.cumsum(slave["sent"])
    master["ramping"][:50] = 1
    delayed = [1 if np.isnan(us) else max(1, round(us / 1e3)) for us in master["one_way_us"].tolist()]
    on_its_way = [any(0 <= tick - sent < delayed[tick] for sent in sends) for tick in range(50, ticks - 1)]
    floor = score(master, slave, data.draw(st.integers(1, 7)))["force"]["violation_floor"]
    assert floor == pytest.approx(sum(on_its_way) / len(on_its_way))


def test_violations_and_errors_in_units_of_the_bound() -> None:
    master, slave = records(1000, phase=0.2e-3), records(1000)
    slave["bound"] = 0.25
    slave["raw"][:, 2] = 0.1
    slave["raw"][500, 2] = 0.25  # on the bound, not outside
    slave["raw"][300:420, 2] = 0.5
    slave["raw"][700, 2] = 0.7
    slave["raw"][900:, 2] = 9.0
    master["ramping"][890:] = 1  # does not count
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
    slave = records(100)
    slave["raw"][:, 2], slave["decoded"][:, 2], slave["bound"] = 2.0, 1.9, 0.2
    slave["coded"] = slave["raw"]
    slave["ramping"][:10] = 1
    slave["decoded"][:10] = 0.0
    slave["rotation_updates_received"] = np.arange(100) // 10
    summary = score(NONE, slave, torque_bank=("zoh",))
    assert summary["force"]["coding"]["error_max"] == pytest.approx(0.1)
    assert summary["force"]["coding"]["violation_fraction"] == 0.0
    assert summary["orientation"]["packets"] == 9
    assert summary["energy"] == {"generated_j": None, "dissipated_j": None} | NO_BOUND


def test_generated_energy_is_the_most_that_was_missing() -> None:
    """1 mJ in, 3 mJ out, 5 mJ in: at most 2 mJ are missing, and 3 mJ remain."""
    master, slave = records(3001), records(3001)
    way = np.concatenate(
        [np.linspace(0.0, 0.01, 1001), np.linspace(0.01, 0.0, 1001)[1:], np.linspace(0.0, 0.01, 1001)[1:]]
    )
    master["position"][:, 2] = slave["output"][:, 2] = way
    master["output"][:1000, 2], master["output"][1000:2000, 2], master["output"][2000:, 2] = -0.1, -0.3, -0.5
    for pieces in (1, 13):
        energy = score(master, slave, pieces)["energy"]
        assert energy["generated_j"] == pytest.approx(0.002)
        assert energy["dissipated_j"] == pytest.approx(0.003)


def test_torque_and_orientation_have_their_figures() -> None:
    master, slave = records(1000), records(1000)
    slave["rotation_raw"][:, 0] = 0.2
    master["rotation_output"][:, 0] = 0.23
    slave["rotation_decoded"][:, 0] = 0.21
    slave["rotation_bound"] = 0.025
    slave["rotation_updates_sent"] = np.arange(1000) // 20
    slave["rotation_selected"][::2] = 1
    slave["rotation_sent"][:10] = 1
    master["rotation_raw"][:, 2] = pi + 0.01
    slave["rotation_output"][:, 2] = -(pi - 0.02)  # 0.01 rad apart
    master["rotation_bound"] = 0.02
    master["rotation_updates_sent"] = np.arange(1000) // 100
    summary = score(master, slave, 7, ("zoh", "linear"))
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
