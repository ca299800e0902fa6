"""A pointer in a whole session: it feels a dome, and lets go."""

from typing import Any

import numpy as np

from tests.master.devices.targets import Targets
from tests.session.systems import configuration
from weberlink.figures.session import score_of
from weberlink.geometry.vector import Vector
from weberlink.master.devices.pointer import PointerDevice
from weberlink.session.simulation import build_simulation

WALL, HAND, REACH = 1500.0, 150.0, 0.04
"""Stiffness of the scenes and of the hand [N/m]; most of the intended position from the handle [m]."""
CENTRE, RADIUS = np.array([0.0, 0.0, -0.025]), 0.04


def over_the_dome(time: float) -> tuple[Vector, bool]:
    """To and fro, one centimetre below the table's surface from 0.5 s on; released at 4 s."""
    height = -0.01 if time > 0.5 else 0.04
    return (0.05 * float(np.sin(1.5 * time)), 0.01 * float(np.cos(2.0 * time)), height), time < 4.0


class Led(PointerDevice):
    def __init__(self, *of: Any) -> None:
        super().__init__(*of, Targets(over_the_dome, 60.0, jitter=0.3))


def lengths(vectors: Any) -> Any:
    return np.linalg.norm(vectors, axis=1)


def test_handle_slides_over_the_dome_and_stays_out_until_it_is_released() -> None:
    easy = ("master.device.scripted=false", "control.scheme=none")
    loaded = configuration(*easy, file="try.yaml", device=Led)
    master, slave = build_simulation(loaded).advance(4400)
    released = slice(4100, None)
    assert not master["output"][released].any() and not np.ptp(slave["output"][released], axis=0).any()
    score = score_of(loaded.system)
    score.add(master[:4000], slave[:4000])
    sliding = master[1500:4000]
    positions = sliding["position"]
    depth = np.maximum(-positions[:, 2], RADIUS - lengths(positions - CENTRE))
    targets = np.array([over_the_dome((tick + 1) * 1e-3)[0] for tick in sliding["tick"]])
    assert (depth <= HAND * lengths(targets - positions) / WALL + 5e-4).all(), "the springs of hand and wall"
    assert depth.max() < HAND * REACH / WALL
    assert np.ptp(positions[:, 2]) > 0.01, "up and down the dome, 15 mm high"
    assert (lengths(sliding["output"]) > 0.1).all(), "in contact all the time"
    force = score.figures().to_json()["force"]
    assert force["coding"]["violation_fraction"] == 0.0
    assert force["violation_fraction"] < 0.05, "felt, with two ticks of delay"
    assert force["packets_per_s"] < 50.0
