"""Live settings: both sides use the same at every tick, over bad links, and keep the laws of what they changed to."""

from dataclasses import dataclass
from itertools import groupby
from math import isfinite
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.compiled import replaces_methods
from tests.examples import examples
from tests.program import ENGAGED
from tests.system.kinds import HAND, Run, run
from tests.system.systems import system
from weberlink.control.tuning import LEAD_TICKS
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.negotiation import PACE, PACE_SHARE
from weberlink.system.side import Side
from weberlink.system.simulation import Simulation
from weberlink.telemetry.record import Record

pytestmark = replaces_methods

RATE = 250.0
LOSTS = 20
"""Exchanges that may be lost in a row: with a loss of 30 % each way, more are lost once in a million changes."""
OVERRIDES = (
    f"rate_hz={RATE:g}",
    "link.silence_ms=400",
    "master.limits.device_ms=30",
    "slave.scene=[]",
)


@dataclass
class Moment:
    """A tick of both sides; whether they are in the same session."""

    master: Record
    slave: Record
    joined: bool


class Pair:
    """A system whose link, and whose sides, a test changes while it runs."""

    def __init__(self, *overrides: str) -> None:
        self._overrides = (*OVERRIDES, *overrides)
        self.simulation: Simulation = system(*self._overrides)
        self.moments: list[Moment] = []
        self.rtt = self.jitter = 0.0
        self._begun = {"master": 0, "slave": 0}
        for name in self._begun:
            self._watch(name)

    def _watch(self, name: str) -> None:
        """Note when a side begins a session."""
        side: Side = getattr(self.simulation, name)
        begin = side._begin

        def noted() -> None:
            self._begun[name] = len(self.moments)
            begin()

        side._begin = noted  # type: ignore[method-assign]

    @property
    def now(self) -> float:
        return len(self.moments) / RATE

    def link(self, rtt: float, jitter: float = 0.0, loss: float = 0.0) -> None:
        self.rtt, self.jitter = max(self.rtt, rtt), max(self.jitter, jitter)
        for link in (self.simulation._forward, self.simulation._backward):
            link._emulation = Emulation(delay_s=0.5 * rtt, jitter_s=jitter, loss=loss)

    def run(self, seconds: float) -> list[Moment]:
        began = len(self.moments)
        for _ in range(round(seconds * RATE)):
            master, slave = self.simulation.step()
            joined = self._begun["slave"] >= self._begun["master"] - 1  # without delay it may hear of it a tick earlier
            self.moments.append(Moment(master, slave, joined))
        return self.moments[began:]

    def restart(self, name: str) -> None:
        """A new process takes the place of a side."""
        fresh = getattr(system(*self._overrides, f"link.emulate={{seed: {len(self.moments)}}}"), name)
        setattr(self.simulation, name, fresh)
        self._watch(name)
        fresh.open(self.now)

    def differences(self) -> list[float]:
        """How long the sides used different Weber factors, each time [s]: at the slave's time on the master's clock."""

        def differs(moment: Moment) -> bool:
            slave = moment.slave
            if not (moment.joined and slave.state == ENGAGED and isfinite(slave.peer_at)):
                return False
            place = round(slave.peer_at * RATE)
            if not 0 <= place < len(self.moments):
                return False
            master = self.moments[place]
            return master.joined and master.master.state == ENGAGED and master.master.weber != slave.weber

        return [len(list(run)) / RATE for is_different, run in groupby(self.moments, differs) if is_different]

    def assert_agreed(self) -> None:
        trip = self.rtt + 2.0 * self.jitter
        bound = LOSTS * max(PACE, 1.0 / RATE, PACE_SHARE * trip) + trip + LEAD_TICKS / RATE
        assert max(self.differences(), default=0.0) <= bound


delays = st.one_of(st.sampled_from([0.0, 0.008, 0.08, 0.1, 0.3]), st.floats(0.0, 0.3))
courses = st.tuples(
    delays,
    st.sampled_from([0.0, 0.01]),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.floats(0.2, 2.0),
    st.sampled_from(["", "silence", "restart slave", "master asks", "slave asks", "both ask"]),
    st.sampled_from([0.05, 0.1, 0.3]),
)


@given(st.lists(courses, min_size=2, max_size=5))
@examples(8)
def test_on_any_link_they_differ_no_longer_than_it_takes_to_repeat(course: list[tuple[Any, ...]]) -> None:
    """With loss, silences, new sessions, and changes by users of both sides. In the end both use what was set last."""
    pair = Pair()
    pair.run(0.5)
    for rtt, jitter, loss, seconds, event, weber in course:
        pair.link(rtt, jitter, loss)
        pair.run(seconds)
        if event == "restart slave":
            pair.restart("slave")
        elif event == "silence":
            pair.link(rtt, jitter, 1.0)
            pair.run(0.3 * seconds)
            pair.link(rtt, jitter, loss)
        for name in ("master", "slave"):
            if event in (f"{name} asks", "both ask"):
                getattr(pair.simulation, name).propose({"weber": weber}, pair.now)
    pair.link(0.002)
    pair.run(2.0)
    pair.assert_agreed()
    last = pair.moments[-1]
    master, slave = pair.simulation.master.tuning, pair.simulation.slave.tuning
    assert last.master.state == last.slave.state == ENGAGED
    assert (master.settings, master.generation) == (slave.settings, slave.generation)
    assert last.master.weber == last.slave.weber == master.settings.weber


# --- what a change does

PLANE = "slave.scene=[{shape: plane, stiffness_n_m: 500}]"


def changed(change: dict[str, Any], asker: str, seconds: float, *overrides: str) -> Run:
    """A session in which one side asks for a change after half a second."""

    def ask(simulation: Simulation) -> None:
        assert getattr(simulation, asker).propose(change, 0.5) is None

    return run(HAND, seconds, *overrides, acts={0.5: ask})


@pytest.mark.parametrize("asker", ["master", "slave"])
@pytest.mark.parametrize("delay_ms", [0, 60])
def test_both_ends_make_a_change_at_the_tick_that_was_agreed(asker: str, delay_ms: int) -> None:
    ran = changed({"weber": 0.3}, asker, 1.0, f"link.emulate={{delay_ms: {delay_ms}}}", "link.silence_ms=400")
    first = {side: int(np.argmax(getattr(ran, side)["settings"] == 1)) for side in ("master", "slave")}
    result = getattr(ran.simulation, asker).tuning.result
    assert (result.refusal, result.tick) == (None, first[asker])
    assert abs(first["master"] - first["slave"]) <= 1
    for side in ("master", "slave"):
        records = getattr(ran, side)
        assert set(records["weber"][: first[side]]) == {0.1} and set(records["weber"][first[side] :]) == {0.3}


@pytest.mark.parametrize(("before", "after", "smooth_ms", "asker"), [(0.1, 0.3, 0, "master"), (0.3, 0.02, 20, "slave")])
def test_the_deadband_is_that_of_the_new_factor_from_the_tick_on(
    before: float, after: float, smooth_ms: int, asker: str
) -> None:
    narrow = ("codec.force.predictor=zoh", "codec.force.floor_n=0", f"codec.force.smooth_ms={smooth_ms}", PLANE)
    ran = changed({"weber": after}, asker, 2.2, f"codec.force.weber={before}", *narrow)
    slave = ran.slave
    counted = (slave["state"] == ENGAGED) & (slave["ramping"] == 0) & (np.abs(slave["raw"][:, 2]) > 0.2)
    ratio = slave["bound"] / np.linalg.norm(slave["raw"], axis=1).clip(1e-9)
    new = counted & (slave["settings"] == 1)
    assert set(ratio[counted & (slave["settings"] == 0)].round(6)) <= {before}
    assert set(ratio[new].round(6)) == {after}
    errors = np.linalg.norm(slave["decoded"] - slave["raw"], axis=1)
    assert (errors[new] <= slave["bound"][new] + 1e-3).all()
    always = run(HAND, 2.2, f"codec.force.weber={after}", *narrow).slave
    assert slave["sent"][new].sum() < 1.5 * always["sent"][new].sum() + 5


def test_another_predictor_is_in_use_at_both_ends_from_the_first_send_on() -> None:
    ran = changed({"predictor": "zoh"}, "slave", 2.5)
    new = ran.slave["settings"] == 1
    assert set(ran.slave["selected"][new]) == {0}, "the bank's first, at the very tick"
    assert set(ran.master["selected"][new][200:]) == {0}
    assert ran.slave["sent"][new].any()


@pytest.mark.parametrize(
    ("overrides", "change"),
    [
        (["control.live_changes=false"], {"weber": 0.2}),
        (["codec.force.predictor=plane"], {"predictor": "zoh"}),
        ([], {"scheme": "none"}),
        ([], {"weber": 1.0}),
        ([], {"weber": -0.1}),
        (["link.emulate.loss=1"], {"weber": 0.2}),
    ],
)
def test_what_the_file_fixes_or_no_session_can_agree_on_stays(overrides: list[str], change: dict[str, Any]) -> None:
    ran = run(HAND, 0.3, *overrides)
    for side in (ran.simulation.master, ran.simulation.slave):
        assert side.propose(change, 0.3)
        assert side.tuning.generation == 0
