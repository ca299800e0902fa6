"""The scene of a configuration as a page draws it: plain shapes, with what files and formulas say filled in."""

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Any

from weberlink.slave.scenes.height_field import bumps, read_heights

MOST_HEIGHTS = 161
"""Rows or columns of a height field that are sent to be drawn."""
_KEYS = {
    "plane": ("point_m", "normal"),
    "sphere": ("center_m", "radius_m"),
    "box": ("center_m", "size_m", "rotation_deg"),
    "height_field": ("bounded",),
}


def drawn(objects: Sequence[Mapping[str, Any]], *, files: bool) -> list[dict[str, Any]]:
    """Shapes to draw, from the `scene` of a configuration that has been checked.

    Args:
        objects: as the description of a daemon has them.
        files: whether what they name are files of this host.
    """
    return [_object(settings, files) for settings in objects if settings.get("shape") in _KEYS]


def _object(settings: Mapping[str, Any], files: bool) -> dict[str, Any]:
    shape: dict[str, Any] = {"shape": settings["shape"]}
    shape |= {key: settings.get(key) for key in _KEYS[settings["shape"]]}
    if "side" in settings:
        shape["inside"] = settings["side"] == "inside"
    if settings["shape"] == "height_field":
        shape |= _heights(settings, files)
    shape["stiffness_n_m"] = settings.get("stiffness_n_m")
    shape["carve"] = drawn(settings.get("carve") or (), files=files)
    return shape


def _heights(settings: Mapping[str, Any], files: bool) -> dict[str, Any]:
    """Rows along y, columns along x, over the centre [m]; None where the file is on another host or gone."""
    heights: Any = settings.get("heights_m")
    spacing = settings.get("spacing_m")
    if settings.get("bumps") is not None:
        of = settings["bumps"]
        heights, spacing = bumps(of["amplitude_m"], of["wavelength_m"], of["size_m"])
    elif settings.get("csv") is not None and files:
        try:
            heights = read_heights(Path(settings["csv"]))
        except ValueError:
            heights = None
    x, y, z = settings.get("center_m") or (0.0, 0.0, 0.0)
    if heights is not None and spacing is not None:
        rows, columns = len(heights), len(heights[0])
        step = max(1, ceil((max(rows, columns) - 1) / (MOST_HEIGHTS - 1)))
        # What does not divide evenly is cut off at the far border, which moves the middle.
        x -= (columns - 1) % step * spacing / 2.0
        y -= (rows - 1) % step * spacing / 2.0
        heights, spacing = [list(row[::step]) for row in heights[::step]], spacing * step
    return {"center_m": [x, y, z], "heights_m": heights, "spacing_m": spacing}
