"""The scenes that `weberlink try` offers: overrides of try.yaml, each with a title for people."""

from collections.abc import Mapping
from typing import NamedTuple


class SceneChoice(NamedTuple):
    """A scene to choose."""

    title: str  # in plain words
    overrides: tuple[str, ...]  # of try.yaml, as of `--set`; none for the scene of the file itself


def _scene(*shapes: str) -> tuple[str, ...]:
    return (f"slave.scene=[{', '.join(f'{{{shape}, stiffness_n_m: 1500}}' for shape in shapes)}]",)


SCENES: Mapping[str, SceneChoice] = {
    "dome": SceneChoice("A dome on a table", ()),
    "plane": SceneChoice(
        "A rough table: it sticks, then slides", _scene("shape: plane, friction: {static: 0.3, dynamic: 0.2}")
    ),
    "box": SceneChoice(
        "A box with sharp edges on a table",
        _scene(
            "shape: box, center_m: [0, 0, 0], size_m: [0.05, 0.05, 0.03], rotation_deg: [0, 0, 30]",
            "shape: plane, point_m: [0, 0, -0.015]",
        ),
    ),
    "bumps": SceneChoice(
        "A field of round bumps", _scene("shape: height_field, bumps: {amplitude_m: 0.003, wavelength_m: 0.03}")
    ),
    "cavity": SceneChoice(
        "A hollow ball, touched from inside",
        _scene("shape: sphere, side: inside, center_m: [0, 0, 0.045], radius_m: 0.05"),
    ),
    "moving": SceneChoice(
        "A plate that rises and falls",
        _scene(
            "shape: box, center_m: [-0.1, 0, -0.05], size_m: [0.2, 0.4, 0.1],"
            " motion: {direction: [0, 0, 1], amplitude_m: 0.01, frequency_hz: 0.4}",
            "shape: plane, point_m: [0, 0, -0.005]",
        ),
    ),
}
"""By name, in the order in which they are shown; the first is that of the file."""
