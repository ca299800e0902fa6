"""Cells that nobody tuned on: scenes, hands, motions, links and delays that a seed draws between and beside the known.

Each is the shipped loopback.yaml with what is drawn as overrides, so `weberlink simulate` runs it too. Delay and what
has no natural scale are drawn evenly by their logarithm, the others evenly.
"""

import json
from collections.abc import Callable
from math import exp, log
from random import Random
from typing import Any

from weberlink_studies.stability.display import DisplayCell

COUNT = 48
"""Cells of one seed; all scenes come equally often."""
REACH_M = 0.025
"""The hand touches the scene within this distance of its middle along x and y [m]."""
Drawn = dict[str, Any]


def held_out(seed: int) -> list[DisplayCell]:
    """The cells of a seed."""
    draw, names = Random(seed), tuple(SCENES)  # noqa: S311 - reproducible
    return [_cell(draw, names[number % len(names)]) for number in range(COUNT)]


def _cell(draw: Random, scene: str) -> DisplayCell:
    delay = round(_between(draw, 5.0, 200.0))
    things, lossy = SCENES[scene](draw), draw.random() < 0.3
    values: dict[str, Any] = {
        "master.device": {"driver": "operator", "hand": _hand(draw), "script": _script(draw)},
        "slave.scene": things,
        "link.emulate.seed": int(1e6 * draw.random()),
    }
    if lossy:
        values["link.emulate.loss"] = _even(draw, 0.01, 0.08)
    if len(things) == 1 and things[0]["shape"] == "plane":  # as in scene-plane.yaml
        values["codec.force.predictor"] = "surface"
    if "motion" not in things[0] and draw.random() < 0.25:
        values["slave.robot"] = {"driver": "simulated", "mass_kg": _between(draw, 0.005, 0.2)}
    overrides = tuple(f"{path}={json.dumps(value)}" for path, value in values.items())
    return DisplayCell(scene, delay, "lossy" if lossy else "clean", "drawn", overrides)


def _even(draw: Random, least: float, most: float) -> float:
    return round(draw.uniform(least, most), 4)


def _between(draw: Random, least: float, most: float) -> float:
    return float(f"{exp(draw.uniform(log(least), log(most))):.3g}")


def _hand(draw: Random) -> Drawn:
    hand = {
        "mass_kg": _between(draw, 0.08, 0.6),
        "damping_n_s_m": _between(draw, 2.5, 18.0),
        "stiffness_n_m": _between(draw, 80.0, 900.0),
    }
    return hand | ({"grasp": "pinch"} if draw.random() < 0.25 else {})


def _script(draw: Random) -> list[Drawn]:
    """Four motions in any order, each from some centimetres above."""

    def point() -> list[float]:
        return [_even(draw, -REACH_M, REACH_M), _even(draw, -REACH_M, REACH_M), 0.0]

    def depth() -> float:
        return _even(draw, 0.008, 0.02)

    motions: list[Drawn] = [
        {"motion": "slide", "points_m": [point(), point()], "depth_m": depth(), "duration_s": _even(draw, 0.8, 2.0)},
        {"motion": "tap", "at_m": point(), "depth_m": depth(), "frequency_hz": _even(draw, 1.0, 3.0), "count": 3},
        {"motion": "press", "at_m": point(), "depth_m": depth(), "hold_s": _even(draw, 0.5, 1.5),
         "duration_s": _even(draw, 0.3, 0.9)},
        {"motion": "circle", "center_m": [0.0, 0.0, 0.0], "radius_m": _even(draw, 0.01, REACH_M), "depth_m": depth(),
         "turns": draw.choice([-1.0, 1.0]), "duration_s": _even(draw, 2.0, 4.0)},
    ]  # fmt: skip
    draw.shuffle(motions)
    return [
        step
        for motion in motions
        for step in (motion, {"motion": "reach", "to_m": [*point()[:2], _even(draw, 0.01, 0.03)], "duration_s": 0.6})
    ]


def _soft(draw: Random) -> Drawn:
    return {"stiffness_n_m": _between(draw, 150.0, 2e3)}


def _plane(draw: Random) -> list[Drawn]:
    normal = [_even(draw, -0.2, 0.2), _even(draw, -0.2, 0.2), 1.0]
    return [{"shape": "plane", "normal": normal} | _soft(draw)]


def _rubbing_plane(draw: Random) -> list[Drawn]:
    static = _even(draw, 0.1, 0.6)
    friction = {"static": static, "dynamic": static * _even(draw, 0.5, 1.0)}
    return [{"shape": "plane", "friction": friction, "damping_n_s_m": _even(draw, 0.3, 4.0)} | _soft(draw)]


def _stiff(draw: Random) -> list[Drawn]:
    return [{"shape": "plane", "stiffness_n_m": _between(draw, 2e3, 2e5)}]


def _dome(draw: Random) -> list[Drawn]:
    radius, material = _even(draw, 0.03, 0.12), _soft(draw)
    ball = {"shape": "sphere", "center_m": [0.0, 0.0, _even(draw, 0.0, 0.006) - radius], "radius_m": radius}
    return [{"shape": "plane"} | material, ball | material]


def _bowl(draw: Random) -> list[Drawn]:
    radius = _even(draw, 0.06, 0.15)
    return [{"shape": "sphere", "center_m": [0.0, 0.0, radius], "radius_m": radius, "side": "inside"} | _soft(draw)]


def _field(draw: Random) -> list[Drawn]:
    bumps = {"amplitude_m": _even(draw, 0.0005, 0.003), "wavelength_m": draw.choice([0.02, 0.03, 0.04, 0.06])}
    return [{"shape": "height_field", "bumps": bumps} | _soft(draw)]


def _box(draw: Random) -> list[Drawn]:
    edge = _even(draw, 0.03, 0.05)
    turned = [0.0, 0.0, _even(draw, 0.0, 90.0)]
    box = {"shape": "box", "center_m": [0.0, 0.0, -0.01], "size_m": [edge, edge, 0.02], "rotation_deg": turned}
    under = {"shape": "plane", "point_m": [0.0, 0.0, -0.02]}
    return [box | _soft(draw), under | _soft(draw)]


def _moving(draw: Random) -> list[Drawn]:
    motion = {
        "direction": [_even(draw, -0.3, 0.3), _even(draw, -0.3, 0.3), 1.0],
        "amplitude_m": _even(draw, 0.001, 0.005),
        "frequency_hz": _even(draw, 0.3, 1.5),
    }
    return [{"shape": "plane", "motion": motion} | _soft(draw)]


SCENES: dict[str, Callable[[Random], list[Drawn]]] = {
    "drawn plane": _plane,
    "drawn rubbing plane": _rubbing_plane,
    "drawn stiff plane": _stiff,
    "drawn dome": _dome,
    "drawn bowl": _bowl,
    "drawn height field": _field,
    "drawn box": _box,
    "drawn moving plane": _moving,
}
"""The objects of a scene, by its name."""
