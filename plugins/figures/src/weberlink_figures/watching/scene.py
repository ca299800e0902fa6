"""What is drawn of a scene, from its configuration."""

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Any

from weberlink.slave.scenes.height_field import bumps, read_heights

MOST_HEIGHTS = 161  # most rows or columns of a height field to send
_KEYS = {
    "plane": ("point_m", "normal"),
    "sphere": ("center_m", "radius_m"),
    "box": ("center_m", "size_m", "rotation_deg"),
    "height_field": ("bounded",),
}


def drawn(objects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Shapes to draw, from the `scene` of a configuration that has been checked."""
    shapes = []
    for settings in objects:
        if settings.get("shape") in _KEYS:
            keys = ("shape", *_KEYS[settings["shape"]], "stiffness_n_m")
            shape: dict[str, Any] = {key: settings.get(key) for key in keys}
            if "side" in settings:
                shape["inside"] = settings["side"] == "inside"
            if settings["shape"] == "height_field":
                shape |= _heights(settings)
            shapes.append(shape | {"carve": drawn(settings.get("carve") or ())})
    return shapes


def _heights(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Heights above the centre [m], rows along y, columns along x; None if the file cannot be read."""
    heights: Any = settings.get("heights_m")
    spacing = settings.get("spacing_m")
    if settings.get("bumps") is not None:
        of = settings["bumps"]
        heights, spacing = bumps(of["amplitude_m"], of["wavelength_m"], of["size_m"])
    elif settings.get("csv") is not None:
        try:
            heights = read_heights(Path(settings["csv"]))
        except ValueError:
            heights = None
    x, y, z = settings.get("center_m") or (0.0, 0.0, 0.0)
    if heights is not None and spacing is not None:
        rows, columns = len(heights), len(heights[0])
        step = max(1, ceil((max(rows, columns) - 1) / (MOST_HEIGHTS - 1)))
        # A remainder is cut off at the far border, which moves the centre.
        x -= (columns - 1) % step * spacing / 2.0
        y -= (rows - 1) % step * spacing / 2.0
        heights, spacing = [list(row[::step]) for row in heights[::step]], spacing * step
    return {"center_m": [x, y, z], "heights_m": heights, "spacing_m": spacing}
