"""Control schemes in whole systems in virtual time: passive on a bad link, few packets, no trace of a lost session."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.system.systems import configuration, output, raw, steps, system
from weberlink.control.auto import MMT, NONE, TDPA
from weberlink.control.table import SCHEMES
from weberlink.geometry.vector import ZERO, dot, subtract
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.protocol.states import State
from weberlink.protocol.wire import Kind, kind_of
from weberlink.system.scoring.energy import PortWork, Records
from weberlink.system.scoring.session import SessionScore
from weberlink.system.simulate import build_simulation
from weberlink.system.simulation import Simulation

TICK = 1e-3
BOUND = 1e-3
"""Energy that may seem to be made [J]."""
BAD_LINK = ("link.emulate.jitter_ms=10", "link.emulate.loss=0.1", "link.emulate.seed=7")
PLANES = (500.0, 1e6)
PRESS_AND_TAP = (
    '[{"motion":"rest","duration_s":0.3},'
    '{"motion":"press","at_m":[0,0,0],"approach_s":0.2,"duration_s":0.3,"hold_s":0.4,"height_m":0.005},'
    '{"motion":"tap","at_m":[0,0,0],"approach_s":0.1,"frequency_hz":4.0,"count":4,"height_m":0.005}]'
)
PRESS_AND_LEAVE = (
    '[{"motion":"rest","duration_s":0.3},'
    '{"motion":"press","at_m":[0,0,0],"approach_s":0.2,"duration_s":0.3,"hold_s":0.4,"height_m":0.005},'
    '{"motion":"reach","to_m":[0,0,0.03],"duration_s":0.4},{"motion":"rest","duration_s":9}]'
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
    def generated_at_the_operator(self) -> float:
        """Of a force that is held over a tick [J]."""
        port = PortWork("output", "position", held=True)
        port.add(self.master)
        return -port.least

    @property
    def generated_between_the_ports(self) -> float:
        """At the robot's by the mean of two forces [J]."""
        given = PortWork("output", "position", held=True).add(self.master)
        taken = PortWork("raw", "output", held=False).add(self.slave)
        return -min(0.0, float((given - taken).min()))

    @property
    def felt(self) -> Any:
        return np.linalg.norm(self.master["output"], axis=1)

    @property
    def measured(self) -> Any:
        return np.linalg.norm(self.slave["raw"], axis=1)

    @property
    def drift(self) -> Any:
        """From the operator to the robot [m]."""
        return np.linalg.norm(self.master["position"] - self.slave["output"], axis=1)


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
def course_of(scheme: str, stiffness: float, round_trip: float, *overrides: str, seconds: float = 3.0) -> Course:
    course = Course()
    on_a_plane(scheme, stiffness, round_trip, *overrides).run(seconds + 2.0 * round_trip, [course])
    return course


@pytest.mark.parametrize("stiffness", PLANES)
@pytest.mark.parametrize(
    ("scheme", "round_trip"),
    [("tdpa", 0.005), ("tdpa", 0.35), ("mmt", 0.7), ("auto", 0.1), ("auto", 0.7)],
)
def test_on_a_bad_link_the_operator_gets_no_energy_out(scheme: str, round_trip: float, stiffness: float) -> None:
    course = course_of(scheme, stiffness, round_trip, *BAD_LINK)
    assert course.generated_at_the_operator <= BOUND
    if scheme == "tdpa":
        assert course.generated_between_the_ports <= BOUND
    assert course.felt.max() <= 10.0 * (1 + 1e-9)
    assert course.felt.max() > 1.0
    assert course.measured.max() > 1.0


def test_without_control_a_delay_of_100_ms_gives_energy_out() -> None:
    """Or the test above could not fail."""
    course = course_of("none", 500.0, 0.1)
    assert course.generated_at_the_operator > 20.0 * BOUND
    assert course.generated_between_the_ports > 20.0 * BOUND


@pytest.mark.parametrize(("scheme", "round_trip", "fewer"), [("tdpa", 0.1, 0.8), ("mmt", 1.0, 0.9)])
def test_the_network_stays_quiet(scheme: str, round_trip: float, fewer: float) -> None:
    """Of the default scene, at k = 0.10: updates of both channels, and every datagram."""
    loaded = configuration(
        f"control.scheme={scheme}",
        f"link.emulate.delay_ms={500.0 * round_trip}",
        "link.silence_ms=1500",
        "link.longest_round_trip_ms=2000",
        "codec.force.weber=0.10",
    )
    score = SessionScore(1000.0, ("zoh", "linear", "plane", "sphere"))
    build_simulation(loaded).run(5.0 + 2.0 * round_trip, [score])
    summary = score.summary()
    assert summary["force"]["packets"] > 5
    assert summary["force"]["reduction"] >= fewer
    assert summary["force"]["reduction_all"] >= fewer
    assert summary["position"]["reduction"] >= fewer


def test_what_the_robot_could_not_afford_is_given_back() -> None:
    """It does not follow into a stiff wall; half a second after the operator has left, it is where the operator is."""
    course = Course()
    on_a_plane("tdpa", 1e6, 0.1, script=PRESS_AND_LEAVE).run(2.8, [course])
    assert course.drift.max() > 5e-3
    assert course.drift[-100:].max() <= 0.5e-3


def test_a_silence_outlasted_in_the_session_makes_no_energy() -> None:
    """The blackout falls into the press; both sides go on with what they had."""
    course = Course()
    simulation = on_a_plane("tdpa", 500.0, 0.04, "link.silence_ms=200", "link.emulate.blackouts_s=[[0.8, 0.6]]")
    simulation.run(3.0, [course])
    states = course.master["state"].tolist()
    assert State.SILENT.value in states
    assert states[-500] == State.ENGAGED.value
    assert course.felt.max() > 1.0
    assert course.generated_at_the_operator <= BOUND
    assert course.generated_between_the_ports <= BOUND


@pytest.mark.parametrize("scheme", ["tdpa", "mmt", "auto"])
def test_a_session_lost_and_begun_anew_starts_from_nothing_and_makes_no_energy(scheme: str) -> None:
    """The slave is built anew, as after a crash of its host; the master finds it by itself."""
    simulation = on_a_plane(scheme, 500.0, 0.04, "link.silence_ms=200")
    fresh = on_a_plane(scheme, 500.0, 0.04, "link.silence_ms=200")
    handed, states, work, held = [], [], [0.0], (ZERO, ZERO)
    for step in steps(simulation, 4.0):
        if step.index == 1000:
            fresh.slave.open(step.slave.at)
            simulation.slave = fresh.slave
        handed.append(simulation.master.port.control.credit)
        states.append(step.master.state)
        force, position = held
        work.append(work[-1] - dot(force, subtract(raw(step.master), position)))
        held = output(step.master), raw(step.master)
        if step.index > 2000:
            assert fresh.slave.endpoint.peer_credit <= handed[-1]
            assert simulation.master.endpoint.peer_credit <= fresh.slave.port.control.credit
    begun = states.index(State.ENGAGED.value, states.index(State.SILENT.value))
    assert begun > 1000
    assert states[-1] == State.ENGAGED.value
    if SCHEMES[scheme].carries_credit:
        assert handed[begun] < handed[begun - 1] < handed[-1]
    assert min(work) >= -BOUND


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
    sizes = {name: [way[Kind.HEARTBEAT] for way in sizes_on_the_wire(f"control.scheme={name}")] for name in SCHEMES}
    for way, without in zip(sizes["mmt"], sizes["none"], strict=True):
        assert way <= without
    for name in ("tdpa", "auto"):
        for with_credit, without in zip(sizes[name], sizes["none"], strict=True):
            assert {size - 4 for size in with_credit} <= without


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        (("control.scheme=tdpa", "control.scheme=none"), "control.scheme: master has 'tdpa', slave has 'none'"),
        (("control.level_j=0.05", "control.level_j=0.1"), "control.level_j: master has 0.05, slave has 0.1"),
    ],
)
def test_ends_that_control_otherwise_name_both_values(overrides: tuple[str, str], complaint: str) -> None:
    simulation = system(overrides[0])
    simulation.slave = system(overrides[1]).slave
    for _ in steps(simulation, 0.5):
        pass
    assert simulation.master.failure == f"refused: {complaint}"


@pytest.mark.parametrize(("round_trip", "scheme"), [(0.001, NONE), (0.03, TDPA), (0.7, MMT)])
def test_auto_ends_up_in_the_scheme_that_the_delay_asks_for(round_trip: float, scheme: int) -> None:
    course = course_of("auto", 500.0, round_trip, *(BAD_LINK if scheme != NONE else ()))
    for records in (course.master, course.slave):
        active = records["control"]
        assert active[0] == TDPA
        assert active[-1] == scheme
