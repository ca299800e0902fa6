"""The history of a whole session against its records."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.watching.feeds import RATE, HandFeed, pieces, records
from weberlink.system.scoring.session import Records
from weberlink.watching.history import FIRST_STEP_S, MOST_BINS, History
from weberlink.watching.session import WatchedSession

ORIGIN = 10.0


def busy(ticks: int, seed: int) -> Records:
    """Records with updates, missed ticks and round trips."""
    made = records(ticks, seed=seed)
    noise = np.random.default_rng(seed)
    made["sent"] = noise.random(ticks) < 0.1
    made["updates_sent"] = 40 + np.cumsum(made["sent"])
    made["ticks_missed"] = np.cumsum(noise.random(ticks) < 0.01)
    made["rtt_us"] = np.where(noise.random(ticks) < 0.5, noise.uniform(100.0, 900.0, ticks), np.nan)
    return made


def check(columns: dict[str, Any], step: float, master: Records, slave: Records) -> None:
    """Compare each bin with the records whose time is in it."""
    places, others = (np.floor((side["at"] - ORIGIN) / step).astype(int) for side in (master, slave))
    force = np.linalg.norm(master["output"], axis=1)
    for bin_, start in enumerate(columns["t"]):
        assert start == pytest.approx(bin_ * step)
        mine, theirs = places == bin_, others == bin_
        assert columns["force_max"][bin_] == pytest.approx(force[mine].max(), abs=1e-6)
        assert columns["rtt_ms"][bin_] == pytest.approx(np.nanmean(master["rtt_us"][mine]) * 1e-3, rel=1e-3)
        sent = int(master["sent"][mine].sum()) + int(slave["sent"][theirs].sum())
        length = min(step, max(master["at"][-1], slave["at"][-1]) - ORIGIN + 1 / RATE - start)
        assert columns["packets"][bin_] == pytest.approx(sent / length, abs=1e-3)
    missed = int(master["ticks_missed"][-1] + slave["ticks_missed"][-1])
    first = int(master["ticks_missed"][0] + slave["ticks_missed"][0])
    assert sum(columns["missed"]) == missed - first


def test_bins_double_and_agree_with_all_records() -> None:
    ticks = 130_000  # 130 s, more than 600 bins of 0.1 s: two doublings
    master, slave = busy(ticks, 1), busy(ticks, 2)
    history = History(RATE, ORIGIN)
    for one, other in zip(np.split(master, 130), np.split(slave, 130), strict=True):
        history.add("master", one)
        history.add("slave", other)
    told = history.message("7")
    assert told["step_s"] == 4 * FIRST_STEP_S and len(told["columns"]["t"]) == 325 <= MOST_BINS
    check(told["columns"], told["step_s"], master, slave)


@given(cuts=st.lists(st.integers(0, 10_000), min_size=3, max_size=3), ticks=st.integers(2000, 4000))
def test_pieces_do_not_change_the_bins(cuts: list[int], ticks: int) -> None:
    made = busy(ticks, 3)
    whole, parts = History(RATE, ORIGIN), History(RATE, ORIGIN)
    whole.add("slave", made)
    for piece in pieces(made, cuts):
        parts.add("slave", piece)
    assert whole.message("7") == parts.message("7")


def test_slave_alone_gives_the_force_of_the_robot() -> None:
    history, made = History(RATE, ORIGIN), busy(50, 4)
    history.add("slave", made)
    (told,) = history.message("7")["columns"]["force_max"]
    assert told == pytest.approx(np.linalg.norm(made["raw"], axis=1).max(), abs=1e-6)


def test_hours_without_records_take_no_more_bins() -> None:
    history = History(RATE, ORIGIN)
    history.add("slave", records(10))
    history.add("slave", records(10, first=20_000_000))
    told = history.message("7")
    assert len(told["columns"]["t"]) <= MOST_BINS
    assert told["columns"]["packets"][1] is None and told["columns"]["force_max"][1] is None
    assert told["step_s"] * len(told["columns"]["t"]) >= 20_000.0


def test_felt_error_of_every_tick_counts() -> None:
    slave, master = HandFeed("slave"), HandFeed("master")
    session = WatchedSession("7", slave)
    session.admit(master)
    felt, measured = records(3000, seed=5), records(3000, seed=6)
    for one, other in zip(np.split(felt, 30), np.split(measured, 30), strict=True):
        master.put(one)
        slave.put(other)
        session.look()
    (columns,) = (session.history["columns"],)
    error = np.linalg.norm(felt["output"] - measured["raw"], axis=1) / measured["bound"]
    assert max(columns["felt_max"]) == pytest.approx(error[:-1].max(), abs=1e-4)
    assert columns["felt_max"][3] == pytest.approx(error[300:400].max(), abs=1e-4)
