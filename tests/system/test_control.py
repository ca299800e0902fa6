"""Control schemes in whole systems in virtual time: passive on a bad link, few packets, no trace of a lost session."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.system.systems import configuration, steps, system
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.protocol.states import State
from weberlink.protocol.wire import Kind, kind_of
from weberlink.system.scoring.bound import accounts_in
from weberlink.system.scoring.energy import Records
from weberlink.system.scoring.session import SessionScore
from weberlink.system.simulate import build_simulation
from weberlink.system.simulation import Simulation
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import RECORD

TICK = 1e-3
BANK = ("zoh", "linear", "plane", "sphere")
ACCOUNTS = accounts_in(configuration().system.model_dump(mode="json"))
BAD_LINK = ("link.emulate.jitter_ms=10", "link.emulate.loss=0.1", "link.emulate.seed=7")
PLANES = (500.0, 1e6)
PRESS_AND_TAP = (
    '[{"motion":"rest","duration_s":0.3},'
    '{"motion":"press","at_m":[0,0,0],"approach_s":0.2,"duration_s":0.3,"hold_s":0.4,"height_m":0.005},'
    '{"motion":"tap","at_m":[0,0,0],"approach_s":0.1,"frequency_hz":4.0,"count":4,"height_m":0.005}]'
)


class Course:
    """The records of a run."""

    def __init__(self) -> None:
        self._masters: list[Records] = []
        self._slaves: list[Records] = []

    def add(self, master: Records, slave: Records) -> None:
        self._masters.append(master)
        self._slaves.append(slave)

    @property
    def master(self) -> Records:
        return np.concatenate(self._masters)

    @property
    def slave(self) -> Records:
        return np.concatenate(self._slaves)

    @property
    def bound_share(self) -> float:
        """The largest share of what the account of the default settings allows out of the hand that came out."""
        score = SessionScore(1000.0, BANK, accounts=ACCOUNTS)
        score.add(self.master, self.slave)
        return float(score.summary()["energy"]["bound_share"])

    @property
    def felt(self) -> Any:
        return np.linalg.norm(self.master["output"], axis=1)

    @property
    def measured(self) -> Any:
        return np.linalg.norm(self.slave["raw"], axis=1)


def on_a_plane(scheme: str, stiffness: float, round_trip: float, *overrides: str, script: str = PRESS_AND_TAP) -> Any:
    return build_simulation(
        configuration(
            f"control.scheme={scheme}",
            f"slave.scene=[{{shape: plane, stiffness_n_m: {stiffness}}}]",
            f"link.emulate.delay_ms={500.0 * round_trip}",
            "link.silence_ms=1500",
            "link.longest_round_trip_ms=2000",
            f"master.device.script={script}",
            "master.device.home_m=[0, 0, 0.005]",
            "slave.robot.home_m=[0, 0, 0.005]",
            *overrides,
        )
    )


@cache
def course_of(scheme: str, stiffness: float, round_trip: float, *overrides: str, seconds: float = 2.4) -> Course:
    course = Course()
    on_a_plane(scheme, stiffness, round_trip, *overrides).run(seconds + 2.0 * round_trip, [course])
    return course


@pytest.mark.parametrize("stiffness", PLANES)
@pytest.mark.parametrize("round_trip", [0.005, 0.1, 0.7])
def test_on_a_bad_link_the_hand_gets_no_more_energy_than_its_bound(round_trip: float, stiffness: float) -> None:
    course = course_of("bounded", stiffness, round_trip, *BAD_LINK)
    assert course.bound_share <= 1.0
    assert course.felt.max() <= 10.0 * (1 + 1e-9)
    assert course.felt.max() > 1.0
    assert course.measured.max() > 1.0


def test_without_control_a_delay_of_100_ms_gives_more_energy_out() -> None:
    """Or the test above could not fail."""
    assert course_of("none", 500.0, 0.1).bound_share > 1.0


@pytest.mark.parametrize(("round_trip", "fewer"), [(0.1, 0.8), (1.0, 0.9)])
def test_the_network_stays_quiet(round_trip: float, fewer: float) -> None:
    """Of the default scene, at k = 0.10: updates of both channels, and every datagram."""
    loaded = configuration(
        f"link.emulate.delay_ms={500.0 * round_trip}",
        "link.silence_ms=1500",
        "link.longest_round_trip_ms=2000",
        "codec.force.weber=0.10",
    )
    score = SessionScore(1000.0, BANK)
    build_simulation(loaded).run(3.5 + 2.0 * round_trip, [score])
    summary = score.summary()
    assert summary["force"]["packets"] > 5
    assert summary["force"]["reduction"] >= fewer
    assert summary["force"]["reduction_all"] >= fewer
    assert summary["position"]["reduction"] >= fewer


def test_a_silence_outlasted_in_the_session_keeps_the_bound() -> None:
    """The blackout falls into the press; both sides go on with what they had."""
    course = Course()
    simulation = on_a_plane("bounded", 500.0, 0.04, "link.silence_ms=200", "link.emulate.blackouts_s=[[0.8, 0.6]]")
    simulation.run(3.0, [course])
    states = course.master["state"].tolist()
    assert State.SILENT.value in states
    assert states[-500] == State.ENGAGED.value
    assert course.felt.max() > 1.0
    assert course.bound_share <= 1.0


def test_a_session_lost_and_begun_anew_starts_with_the_allowance_and_keeps_the_bound() -> None:
    """The slave is built anew, as after a crash of its host; the master finds it by itself."""
    simulation = on_a_plane("bounded", 500.0, 0.04, "link.silence_ms=200")
    fresh = on_a_plane("bounded", 500.0, 0.04, "link.silence_ms=200")
    course = Course()
    for step in steps(simulation, 3.4):
        if step.index == 1000:
            fresh.slave.open(step.slave.at)
            simulation.slave = fresh.slave
        course.add(*(np.frombuffer(RECORD.pack(*side), DTYPE) for side in (step.master, step.slave)))
    master = course.master
    states = master["state"].tolist()
    begun = states.index(State.ENGAGED.value, states.index(State.SILENT.value))
    assert begun > 1000
    assert states[-1] == State.ENGAGED.value
    assert master["energy"][begun] == pytest.approx(ACCOUNTS[0].allowance, rel=0.01)
    assert course.bound_share <= 1.0


class Tapped(EmulatedLink[Address]):
    """A link that knows the size of all that was sent, by kind."""

    def __init__(self) -> None:
        super().__init__(Emulation(delay_s=0.001), lambda: 0.0)
        self.sizes: dict[Kind, set[int]] = {}

    def send(self, data: bytes, tag: Address, now: float) -> None:
        self.sizes.setdefault(Kind(kind_of(data)), set()).add(len(data))
        super().send(data, tag, now)


def sizes_on_the_wire(*overrides: str) -> tuple[dict[Kind, set[int]], dict[Kind, set[int]]]:
    built = system(*overrides)
    links = Tapped(), Tapped()
    simulation = Simulation(master=built.master, slave=built.slave, links=links, tick_period=TICK)
    for _ in steps(simulation, 2.0):
        pass
    return links[0].sizes, links[1].sizes


def test_credit_costs_four_bytes_in_a_heartbeat_and_nothing_where_none_is_carried() -> None:
    sizes = [
        [way[Kind.HEARTBEAT] for way in sizes_on_the_wire(f"control.scheme={name}")] for name in ("bounded", "none")
    ]
    for with_credit, without in zip(*sizes, strict=True):
        assert {size - 4 for size in with_credit} <= without
