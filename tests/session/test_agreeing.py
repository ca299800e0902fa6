"""Live settings: both sides use the same at every tick, over bad links, and keep the laws of what they changed to."""

from collections.abc import Callable
from functools import partial
from itertools import groupby
from random import Random
from typing import Any

import numpy as np
import pytest

from tests.program import ENGAGED
from tests.session.kinds import HAND, TICK, Run, run
from weberlink.protocol.negotiation import PACE, PACE_SHARE
from weberlink.session.simulation import Simulation
from weberlink.session.tuning import MARGIN_TICKS

LOSTS = 20  # exchanges that may be lost in a row: with a loss of 30 % each way, more are lost once in a million changes


@pytest.mark.parametrize("seed", [0, 5, *(pytest.param(each, marks=pytest.mark.hunt) for each in range(20))])
def test_on_any_link_they_differ_no_longer_than_it_takes_to_repeat(seed: int) -> None:
    """With loss, a silence, and changes by users of both sides. In the end both use what was set last."""
    chance = Random(seed)
    rtt, jitter, loss = (chance.choice(each) for each in ((0.0, 0.08, 0.3), (0.0, 0.01), (0.0, 0.1, 0.3)))
    link = (
        f"link.emulate={{delay_ms: {500.0 * rtt}, jitter_ms: {1e3 * jitter}, loss: {loss}, seed: {seed},"
        " blackouts_s: [[1.9, 0.5]]}"
    )

    def ask(sides: tuple[str, ...], weber: float, at: float, simulation: Simulation) -> None:
        for side in sides:  # in vain where there is no session, or a change under way
            getattr(simulation, side).propose({"weber": weber}, at)

    acts: dict[float, Callable[[Simulation], object]] = {}
    for at in (0.8, 1.3, 1.8, 2.6, 3.2):
        sides = chance.choice([("master",), ("slave",), ("master", "slave")])
        acts[at] = partial(ask, sides, chance.choice([0.05, 0.2, 0.3]), at)
    ran = run(HAND, 5.0, link, "link.silence_ms=400", acts=acts)
    trip = rtt + 2.0 * jitter
    bound = LOSTS * max(PACE, PACE_SHARE * trip) + trip + MARGIN_TICKS * TICK
    both = (ran.master["state"] == ENGAGED) & (ran.slave["state"] == ENGAGED)
    differs = both & (ran.master["weber"] != ran.slave["weber"])
    assert (
        max((len(list(ticks)) * TICK for is_different, ticks in groupby(differs) if is_different), default=0.0) <= bound
    )
    master, slave = ran.simulation.master.tuning, ran.simulation.slave.tuning
    assert (master.settings, master.generation) == (slave.settings, slave.generation)
    assert master.generation > 0
    assert ran.master["weber"][-1] == ran.slave["weber"][-1] == master.settings.weber


# --- what a change does

PLANE = "slave.scene=[{shape: plane, stiffness_n_m: 500}]"


def changed(change: dict[str, Any], asker: str, seconds: float, *overrides: str) -> Run:
    """A session in which one side asks for a change after half a second."""

    def ask(simulation: Simulation) -> None:
        assert getattr(simulation, asker).propose(change, 0.5) is None

    return run(HAND, seconds, *overrides, acts={0.5: ask})


@pytest.mark.parametrize(("asker", "delay_ms"), [("master", 60), ("slave", 0)])
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
        (["link.emulate.loss=1"], {"weber": 0.2}),
    ],
)
def test_what_the_file_fixes_or_no_session_can_agree_on_stays(overrides: list[str], change: dict[str, Any]) -> None:
    ran = run(HAND, 0.3, *overrides)
    for side in (ran.simulation.master, ran.simulation.slave):
        assert side.propose(change, 0.3)
        assert side.tuning.generation == 0
