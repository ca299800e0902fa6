"""A pointer in a whole session: it feels a dome, jumps, lets go."""

from typing import Any

import numpy as np
import pytest

from tests.master.devices.targets import Path, Targets
from tests.session.systems import configuration
from weberlink.figures.session import Layout, Records, SessionScore
from weberlink.geometry.vector import Vector
from weberlink.master.devices.pointer import PointerDevice
from weberlink.session.simulation import build_simulation

WALL, HAND = 1500.0, 150.0
"""Stiffness of the scenes and of the hand [N/m]."""
SPEED, REACH = 0.5, 0.04
"""Bounds of the intended position: [m/s], and [m] from the handle."""
RAMP_S = 0.05
CENTRE, RADIUS = np.array([0.0, 0.0, -0.025]), 0.04
EASY = ("master.device.scripted=false", "control.scheme=none")


def run(
    path: Path, seconds: float, *overrides: str, score: SessionScore | None = None, rate: float = 60.0
) -> tuple[Records, Records]:
    """Records of a session of configs/try.yaml that is led along a path, without the fade at its end."""
    source = Targets(path, rate, jitter=0.3)

    class Led(PointerDevice):
        def __init__(self, *of: Any) -> None:
            super().__init__(*of, source)

    simulation = build_simulation(configuration(*EASY, *overrides, file="try.yaml", device=Led))
    master, slave = simulation.advance(round(1000 * seconds))
    if score is not None:
        score.add(master, slave)
    return master, slave


def lengths(vectors: Any) -> Any:
    return np.linalg.norm(vectors, axis=1)


def depths(positions: Any) -> Any:
    """Below the surface of the dome on the table [m]."""
    return np.maximum(-positions[:, 2], RADIUS - lengths(positions - CENTRE))


def over_the_dome(time: float) -> tuple[Vector, bool]:
    """To and fro, one centimetre below the table's surface from 0.5 s on."""
    return (0.05 * float(np.sin(1.5 * time)), 0.01 * float(np.cos(2.0 * time)), -0.01 if time > 0.5 else 0.04), True


def test_handle_slides_over_the_dome_and_stays_out() -> None:
    score = SessionScore(Layout(1000.0, ("zoh", "linear", "plane", "sphere")))
    master, _ = run(over_the_dome, 4.0, score=score)
    sliding = master[1500:]
    positions, depth = sliding["position"], depths(sliding["position"])
    targets = np.array([over_the_dome((tick + 1) * 1e-3)[0] for tick in sliding["tick"]])
    assert (depth <= HAND * lengths(targets - positions) / WALL + 5e-4).all(), "the springs of hand and wall"
    assert depth.max() < HAND * REACH / WALL
    assert np.ptp(positions[:, 2]) > 0.01, "up and down the dome, 15 mm high"
    assert (lengths(sliding["output"]) > 0.1).all(), "in contact all the time"
    force = score.figures().to_json()["force"]
    assert force["coding"]["violation_fraction"] == 0.0
    assert force["violation_fraction"] < 0.05, "felt, with two ticks of delay"
    assert force["packets_per_s"] < 50.0


@pytest.mark.parametrize(("goes_silent", "limit"), [(False, 0.1), (True, 0.1 + RAMP_S + 0.02)])
def test_released_handle_has_no_force_and_the_robot_holds(goes_silent: bool, limit: float) -> None:
    def pressed(time: float) -> tuple[Vector, bool] | None:
        return ((0.05, 0.05, -0.03), True) if time < 2.0 else None if goes_silent else ((0.05, 0.05, -0.03), False)

    master, slave = run(pressed, 3.0)
    assert lengths(master["output"])[1900] > 2.0
    after = master["at"] > 2.0 + limit
    assert (master["output"][after] == 0.0).all()
    assert (master["buttons"][after] == 0).all()
    held = slave["output"][slave["at"] > 2.0 + limit]
    assert (held == held[0]).all()
    assert abs(held[0][2]) < 5e-3, "where it was"
    rest = master["position"][after]
    assert lengths(rest - rest[-1]).max() < 5e-3, "so does the hand"
