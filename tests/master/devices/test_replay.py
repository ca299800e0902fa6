from itertools import pairwise
from math import sin
from pathlib import Path
from typing import Any

import pytest

from weberlink.geometry.vector import Vector, distance
from weberlink.master.devices.hand_options import HandOptions
from weberlink.master.devices.replay import ReplayDevice, ReplayOptions

TICK = 0.001
STIFF = HandOptions(mass_kg=0.01, damping_n_s_m=20.0, stiffness_n_m=10_000.0)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two seconds of a slow swing about (0.1, 0.2, 0.3), starting at t = 50 s."""
    path = tmp_path / "swing.csv"
    rows = [
        f"{50 + i * 0.01},{0.1 + 0.01 * sin(0.03 * i)},{0.2 + 0.00002 * i},{0.3 - 0.00003 * i},1,2,3"
        for i in range(201)
    ]
    path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
    return path


def run(recording: Path, seconds: float, **options: Any) -> list[tuple[Vector, bool]]:
    defaults: dict[str, Any] = {
        "trace": recording,
        "hand": STIFF,
        "tremor_m": 0.0,
        "anchor": "first",
        "center_m": (0.01, 0.02, 0.0),
    }
    device = ReplayDevice(ReplayOptions(**(defaults | options)), TICK)
    device.open(7.0)
    readings = [device.latest(7.0 + tick * TICK) for tick in range(1, round(seconds / TICK) + 1)]
    return [(reading.position, reading.ended) for reading in readings]


def swing(time: float, scale: float = 1.0) -> Vector:
    """The recording from its first sample moved to (0.01, 0.02, 0)."""
    i = time / 0.01
    return (0.01 + scale * 0.01 * sin(0.03 * i), 0.02 + scale * 0.00002 * i, -scale * 0.00003 * i)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_after_the_approach_it_follows_the_recording(recording: Path, scale: float) -> None:
    steps = run(recording, 3.5, scale=scale)
    for tick in range(1200, 2900, 50):
        assert distance(steps[tick - 1][0], swing((tick - 1000) * TICK, scale)) < 2e-4 * scale
    assert [ended for _, ended in steps].index(True) in (2999, 3000)
    assert distance(steps[-1][0], swing(2.0, scale)) < 1e-5


def test_repeat_goes_back_and_on(recording: Path) -> None:
    steps = run(recording, 8.0, repeat=True)
    assert not any(ended for _, ended in steps)
    for tick in range(4200, 5900, 50):
        assert distance(steps[tick - 1][0], swing((tick - 4000) * TICK)) < 2e-4
    places = [position for position, _ in steps]
    assert max(distance(a, b) for a, b in pairwise(places)) < 1e-4


def test_axes_are_taken_as_named(recording: Path) -> None:
    steps = run(recording, 3.0, axes="-y+z+x", center_m=(0.0, 0.0, 0.0))
    x, y, z = swing(1.5)
    assert steps[2499][0] == pytest.approx((-(y - 0.02), z, x - 0.01), abs=2e-4)
