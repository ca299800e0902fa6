"""A hand against a scene, the force arriving late: the closed loop that everything else is put into."""

from collections import deque
from typing import Any

import pytest
from pydantic import TypeAdapter

from weberlink.geometry.vector import ZERO, Vector, norm, subtract
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.slave.scenes.settings import SceneSettings, build

TICK = 0.001
SCENES: TypeAdapter[Any] = TypeAdapter(SceneSettings)
ROUGH = {"friction": {"static": 0.4, "dynamic": 0.3}, "damping_n_s_m": 1.0}


def forces(thing: dict[str, Any], delay: int, seconds: float, **options: Any) -> list[Vector]:
    scene = build(SCENES.validate_python([thing]))
    device = OperatorDevice(OperatorOptions(**options), TICK)
    device.open(0.0)
    on_the_way = deque([ZERO] * delay)
    felt: list[Vector] = []
    for tick in range(1, round(seconds / TICK) + 1):
        now = tick * TICK
        felt.append(scene.force(device.latest(now).position, TICK))
        on_the_way.append(felt[-1])
        device.command(on_the_way.popleft(), now)
    return felt


@pytest.mark.parametrize(
    "thing",
    [
        {"shape": "plane", "stiffness_n_m": 1000},
        {"shape": "plane", "stiffness_n_m": 600, **ROUGH},
    ],
    ids=["stiff", "rough"],
)
def test_the_default_script_explores_a_surface_calmly(thing: dict[str, Any]) -> None:
    felt = forces(thing, 2, 8.0)
    touching = sorted(norm(force) for force in felt if force != ZERO)
    assert len(touching) > 3000
    assert 1.0 < touching[len(touching) // 2] < 5.0
    assert touching[-1] < 8.0


@pytest.mark.parametrize("stiffness", [300.0, 1000.0])
def test_a_held_press_settles(stiffness: float) -> None:
    """Within two hundredths of a newton of f = x / (1 / k_hand + 1 / k_wall) once the tremor is switched off."""
    script = [{"motion": "press", "at_m": [0, 0, 0], "depth_m": 0.02, "hold_s": 2.0}]
    felt = forces({"shape": "plane", "stiffness_n_m": stiffness}, 2, 3.3, script=script, tremor_m=0.0)
    expected = (0.0, 0.0, 0.02 / (1.0 / 300.0 + 1.0 / stiffness))
    assert all(norm(subtract(force, expected)) < 0.02 for force in felt[-500:])
