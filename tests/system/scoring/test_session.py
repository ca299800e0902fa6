"""The join of two records, on records made by hand."""

import numpy as np
import pytest

from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records, SessionScore
from weberlink.telemetry.reader import DTYPE

RATE = 1000.0


def records(ticks: int, *, phase: float = 0.0) -> Records:
    made = np.zeros(ticks, DTYPE)
    made["tick"] = np.arange(ticks)
    made["at"] = 10.0 + phase + np.arange(ticks) / RATE
    made["state"] = State.ENGAGED.value
    made["rtt_us"] = made["one_way_us"] = np.nan
    return made


def score(master: Records, slave: Records, pieces: int = 1) -> dict[str, object]:
    scored = SessionScore(RATE, ("zoh", "plane"))
    for one, other in zip(np.array_split(master, pieces), np.array_split(slave, pieces), strict=True):
        scored.add(one, other)
    return scored.summary()


def test_felt_error_compares_the_same_moment_on_both_sides() -> None:
    master, slave = records(1000, phase=0.2e-3), records(1000)
    slave["raw"][:, 2] = np.arange(1000) * 0.01
    master["output"][:, 2] = np.arange(1000) * 0.01 + 0.5
    slave["bound"] = 0.4
    force = score(master, slave)["force"]
    assert force["error_rms"] == pytest.approx(0.5)  # type: ignore[index]
    assert force["violation_fraction"] == 1.0  # type: ignore[index]
    slave["bound"] = 0.6
    assert score(master, slave)["force"]["violation_fraction"] == 0.0  # type: ignore[index]


def test_the_figures_do_not_depend_on_how_the_records_come_in_pieces() -> None:
    rng = np.random.default_rng(1)
    master, slave = records(3000, phase=0.4e-3), records(3000)
    for side in (master, slave):
        for name in ("raw", "output", "decoded"):
            side[name] = rng.normal(size=(3000, 3))
        side["bound"] = 1.5
    whole, pieces = score(master, slave), score(master, slave, pieces=37)
    for channel in ("force", "position"):
        for key in ("error_rms", "error_max", "violation_fraction"):
            assert pieces[channel][key] == pytest.approx(whole[channel][key], rel=2e-3)  # type: ignore[index]
    assert pieces["energy"]["dissipated_j"] == pytest.approx(whole["energy"]["dissipated_j"], rel=1e-2, abs=0.1)  # type: ignore[index]


def test_ticks_of_a_ramp_or_out_of_session_do_not_count() -> None:
    master, slave = records(1000), records(1000)
    slave["raw"][:, 2] = 1.0
    master["ramping"][:500] = 1
    slave["state"][500:900] = State.SILENT.value
    master["output"][900:, 2] = 1.0
    force = score(master, slave)["force"]
    assert force["error_max"] == pytest.approx(0.0)  # type: ignore[index]


def test_reduction_counts_updates_and_all_datagrams_against_engaged_ticks() -> None:
    master, slave = records(1000), records(1000)
    slave["updates_sent"] = np.linspace(0, 50, 1000).astype(int)
    slave["datagrams_sent"] = np.linspace(0, 70, 1000).astype(int)
    slave["selected"][::2] = 1
    slave["sent"][:10] = 1
    force = score(master, slave)["force"]
    assert force["packets"] == 50  # type: ignore[index]
    assert force["reduction"] == pytest.approx(0.95)  # type: ignore[index]
    assert force["reduction_all"] == pytest.approx(0.93)  # type: ignore[index]
    assert force["selected"] == {"zoh": 5, "plane": 5}  # type: ignore[index]
    assert force["violation_floor"] == pytest.approx(0.05)  # type: ignore[index]


def test_what_the_operator_gets_out_beyond_what_was_put_in_is_generated() -> None:
    """1 mJ in, 3 mJ out, 5 mJ in: the most that was ever missing is 2 mJ, and in the end 3 mJ are left behind."""
    master, slave = records(3001), records(3001)
    way = np.concatenate(
        [np.linspace(0.0, 0.01, 1001), np.linspace(0.01, 0.0, 1001)[1:], np.linspace(0.0, 0.01, 1001)[1:]]
    )
    master["raw"][:, 2] = slave["output"][:, 2] = way
    master["output"][:1000, 2], master["output"][1000:2000, 2], master["output"][2000:, 2] = -0.1, -0.3, -0.5
    for pieces in (1, 13):
        energy = score(master, slave, pieces)["energy"]
        assert energy["generated_j"] == pytest.approx(0.002)  # type: ignore[index]
        assert energy["dissipated_j"] == pytest.approx(0.003)  # type: ignore[index]
        assert energy["link_generated_j"] == pytest.approx(0.002)  # type: ignore[index]


def test_a_held_force_is_counted_over_the_tick_that_it_is_held() -> None:
    """The samples of a spring, held: what comes out on the way back exceeds what went in by k dx^2 a tick each way."""
    stiffness, step, count = 500.0, 1e-5, 400
    way = step * np.concatenate([np.arange(count), np.arange(count, -1, -1), [0, 0]])
    master, slave = records(len(way)), records(len(way))
    master["raw"][:, 2] = slave["output"][:, 2] = way
    master["output"][:, 2] = slave["raw"][:, 2] = -stiffness * way
    energy = score(master, slave)["energy"]
    made = stiffness * step**2 * count
    assert energy["generated_j"] == pytest.approx(made, rel=1e-6)  # type: ignore[index]
    assert energy["dissipated_j"] == 0.0  # type: ignore[index]
    assert energy["link_generated_j"] == pytest.approx(made, rel=1e-6)  # type: ignore[index]


def test_energy_of_the_link_is_what_the_operator_gave_less_what_the_robot_got() -> None:
    """A spring that pushes the operator out harder than the robot was pushed makes energy."""
    master, slave = records(1001), records(1001)
    way = np.linspace(0.0, 0.01, 1001)
    master["raw"][:, 2] = slave["output"][:, 2] = way
    master["output"][:, 2], slave["raw"][:, 2] = 3.0, 1.0
    energy = score(master, slave)["energy"]
    assert energy["link_generated_j"] == pytest.approx(0.02, rel=2e-3)  # type: ignore[index]
    assert energy["generated_j"] == pytest.approx(0.03)  # type: ignore[index]
    master["raw"][:, 2] = slave["output"][:, 2] = way[::-1]
    energy = score(master, slave)["energy"]
    assert energy["link_generated_j"] == energy["generated_j"] == 0.0  # type: ignore[index]
    assert energy["dissipated_j"] == pytest.approx(0.03)  # type: ignore[index]


def test_energy_counts_in_ramps_and_that_of_the_link_only_in_a_session_of_both() -> None:
    """The newest tick of the slave still waits for a nearer one of the master."""
    master, slave = records(1000), records(1000)
    master["raw"][:, 2] = slave["output"][:, 2] = np.arange(1000) * 1e-5
    master["output"][:, 2] = 1.0
    master["ramping"][:100] = slave["ramping"][50:300] = 1
    slave["state"][400:600] = State.SILENT.value
    energy = score(master, slave, 7)["energy"]
    assert energy["generated_j"] == pytest.approx(999e-5)  # type: ignore[index]
    assert energy["link_generated_j"] == pytest.approx((399 + 398) * 1e-5)  # type: ignore[index]


def test_a_missed_tick_is_counted_and_a_lost_record_is_not() -> None:
    """Each side's work is summed on its own ticks; the slave's newest waits for a nearer one of the master."""
    master, slave = records(1000), records(1000)
    master["raw"][:, 2] = slave["output"][:, 2] = np.arange(1000) * 1e-5
    master["output"][:, 2] = 1.0
    kept = np.delete(master, range(500, 520))
    assert score(kept, slave)["energy"]["generated_j"] == pytest.approx((999 - 21) * 1e-5)  # type: ignore[index]
    kept["ticks_missed"][500:] = 20
    energy = score(kept, slave)["energy"]
    assert energy["generated_j"] == pytest.approx(999e-5)  # type: ignore[index]
    assert energy["link_generated_j"] == pytest.approx(998e-5)  # type: ignore[index]


def test_the_longest_time_outside_spans_pieces() -> None:
    master, slave = records(1000), records(1000)
    slave["raw"][300:420, 2] = 1.0
    slave["raw"][800:830, 2] = 1.0
    force = score(master, slave, pieces=10)["force"]
    assert force["violation_longest_ticks"] == 120  # type: ignore[index]
    assert force["violation_longest_s"] == pytest.approx(0.12)  # type: ignore[index]
    assert force["violation_s"] == pytest.approx(0.15)  # type: ignore[index]


def test_how_far_outside_is_told_in_units_of_the_bound() -> None:
    master, slave = records(1000), records(1000)
    slave["bound"] = 0.2
    slave["raw"][:, 2] = 0.1
    slave["raw"][500:520, 2] = 0.5
    slave["raw"][700, 2] = 0.7
    slave["bound"][800:] = 0.0
    force = score(master, slave)["force"]
    assert force["violation_max_jnd"] == pytest.approx(3.5)  # type: ignore[index]
    assert force["violation_p99_jnd"] == pytest.approx(2.5, rel=0.01)  # type: ignore[index]


def test_a_side_alone_has_its_own_figures_and_no_felt_error() -> None:
    summary = score(records(100), np.empty(0, DTYPE))
    assert summary["ticks"]["master"]["count"] == 100  # type: ignore[index]
    assert summary["ticks"]["slave"]["lateness_us"]["p50"] is None  # type: ignore[index]
    assert summary["force"]["error_rms"] is None  # type: ignore[index]
    assert summary["force"]["violation_max_jnd"] is summary["force"]["violation_longest_s"] is None  # type: ignore[index]
    assert summary["energy"] == {"generated_j": 0.0, "dissipated_j": 0.0, "link_generated_j": None}


def test_the_slave_alone_knows_no_energy_of_the_operator() -> None:
    energy = score(np.empty(0, DTYPE), records(100))["energy"]
    assert energy == {"generated_j": None, "dissipated_j": None, "link_generated_j": None}


def test_the_slave_alone_knows_its_coding_error() -> None:
    slave = records(100)
    slave["raw"][:, 2], slave["decoded"][:, 2], slave["bound"] = 2.0, 1.9, 0.2
    slave["ramping"][:10] = 1
    slave["decoded"][:10] = 0.0
    coding = score(np.empty(0, DTYPE), slave)["force"]["coding"]  # type: ignore[index]
    assert coding["error_max"] == pytest.approx(0.1)
    assert coding["violation_fraction"] == 0.0
