"""No force without a contact, in whole sessions: what was reported, robots that are held back, and random ones."""

import numpy as np
import pytest

from tests.session.systems import configuration
from trials.safety.unfounded import Cell, Finding, found
from weberlink.session.simulation import build_simulation
from weberlink.telemetry.fault import Fault

DELAY_S = 0.05
LINK = ("link.emulate={delay_ms: 50, seed: 0}",)


def session(*overrides: str, file: str = "loopback.yaml", seconds: float = 4.0) -> Finding:
    """What a session showed."""
    loaded = configuration(*LINK, *overrides, file=file)
    period = loaded.system.tick_period
    master, slave = build_simulation(loaded).advance(round(seconds / period))
    return found(Cell(0, overrides, (DELAY_S, DELAY_S)), master, slave, period)


PRESS = "master.device.script=[{motion: press, at_m: [-0.01, 0, 0], depth_m: 0.03, hold_s: 3, duration_s: 0.4}]"


@pytest.mark.parametrize(("predictor", "scheme"), [("zoh", "none"), ("plane", "bounded")])
def test_a_robot_that_has_backed_off_leaves_the_hand(predictor: str, scheme: str) -> None:
    check_that_the_hand_is_left(predictor, scheme)


def check_that_the_hand_is_left(predictor: str, scheme: str) -> None:
    """It touches nothing and its model states nothing there, while the hand presses on the same model."""
    asked = (f"codec.force.predictor={predictor}", f"control.scheme={scheme}")
    finding = session(PRESS, "slave.limits.trip_n=4", *asked, seconds=2.0)
    assert 0.0 < finding.contact < 0.2
    assert (finding.ticks, finding.faults) == (0, 0)


@pytest.mark.parametrize(("scheme", "delay_ms"), [("none", 250), ("bounded", 0)])
def test_a_clean_session_is_never_at_fault(scheme: str, delay_ms: int) -> None:
    loaded = configuration(
        f"control.scheme={scheme}",
        f"link.emulate={{delay_ms: {delay_ms}, jitter_ms: 5, loss: 0.02, seed: 1}}",
        f"link.longest_round_trip_ms={4 * delay_ms + 400}",
    )
    simulation = build_simulation(loaded)
    master, _ = simulation.advance(4000)
    assert Fault.UNFOUNDED not in set(master["fault"])
    assert np.abs(master["output"][:, 2]).max() > 1.0


def test_a_lost_correction_of_a_model_leaves_the_hand_as_soon_as_one_that_comes() -> None:
    """The model of one bump claims a contact above the others, and the first loss of all takes the update that says
    so. Nothing else comes while the robot's end waits for its acknowledgement: a force lasted for 421 ms."""
    link = "link.emulate={delay_ms: 100, jitter_ms: 5, loss: 0.05, burst: 3, seed: 6}"
    loaded = configuration(link, "link.silence_ms=637", file="scene-height-field.yaml")
    period = loaded.system.tick_period
    cell = Cell(6, (), (0.1, 0.1), jitter_s=0.005)
    finding = found(cell, *build_simulation(loaded).advance(round(5.6 / period)), period)
    assert (finding.ticks, finding.faults) == (0, 0)
