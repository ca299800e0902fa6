from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from weberlink.slave.scenes.settings import SceneSettings, build

SCENE: TypeAdapter[Any] = TypeAdapter(SceneSettings)
TICK = 0.001


def force_of(scene: list[dict[str, Any]], position: tuple[float, float, float]) -> tuple[float, float, float]:
    """After a straight way down from 5 cm above `position`."""
    built = build(SCENE.validate_python(scene))
    force = (0.0, 0.0, 0.0)
    for i in range(101):
        force = built.force((position[0], position[1], position[2] + 0.05 * (1.0 - i / 100)), TICK)
    return force


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("0,1\n0,nan\n", "row 2"),
        ("0,1\n0,1,2\n", "row 2: expected 2 values, found 3"),
        ("", "at least 2 rows"),
        (None, "readable"),
    ],
)
def test_bad_height_file_error_names_row(tmp_path: Path, content: str | None, expected: str) -> None:
    path = tmp_path / "heights.csv"
    if content is not None:
        path.write_text(content)
    scene = SCENE.validate_python([{"shape": "height_field", "csv": path, "spacing_m": 0.01, "stiffness_n_m": 500}])
    with pytest.raises(ValueError, match=expected):
        build(scene)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"stiffness_n_m": 0}, "stiffness_n_m"),
        ({"stiffness_n_m": float("nan")}, "stiffness_n_m"),
        ({"normal": [0, 0, 0]}, "normal"),
        ({"damping_n_s_m": -1}, "damping_n_s_m"),
        ({"friction": {"static": 0.3, "dynamic": 0.4}}, "dynamic"),
        ({"shape": "cone"}, "shape"),
        ({"shape": "sphere", "center_m": [0, 0, 0], "radius_m": -1}, "radius_m"),
        ({"shape": "box", "center_m": [0, 0, 0], "size_m": [1, 1, 0]}, "size_m"),
        ({"shape": "height_field"}, "exactly one of"),
        ({"shape": "height_field", "heights_m": [[0, 0], [0]], "spacing_m": 0.1}, "heights_m"),
        ({"shape": "height_field", "bumps": {"amplitude_m": 0.001, "wavelength_m": 0.0001}}, "size_m"),
        ({"carve": [{"shape": "height_field"}]}, "carve"),
        ({"motion": {"amplitude_m": 0.0, "frequency_hz": 2.0}}, "greater than 0"),
        ({"motion": {"amplitude_m": 5.0, "frequency_hz": 2.0}}, r"peak speed of at most 10 m/s, got 62\.8 m/s"),
        ({"motion": {"amplitude_m": 0.01, "frequency_hz": 2.0, "direction": [0, 0, 0]}}, "longer than zero"),
    ],
)
def test_a_wrong_setting_is_refused_by_name(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ValidationError, match=field):
        SCENE.validate_python([{"shape": "plane", "stiffness_n_m": 500} | change])


def test_object_moves_as_configured() -> None:
    still = {"shape": "plane", "stiffness_n_m": 500}
    assert not build(SCENE.validate_python([still, still])).moves
    motion = {"amplitude_m": 0.01, "frequency_hz": 2.0, "direction": [0, 0, -3], "phase_deg": 90.0}
    scene = build(SCENE.validate_python([still | {"motion": motion}]))
    assert scene.moves
    scene.force((0.0, 0.0, 0.02), 0.0)
    assert scene.force((0.0, 0.0, -0.011), 0.0) == pytest.approx((0.0, 0.0, 0.5))
    assert scene.force((0.0, 0.0, 0.009), 0.25) == pytest.approx((0.0, 0.0, 0.5))


BOX = {"shape": "box", "center_m": [0, 0, -0.01], "size_m": [0.02, 0.02, 0.02]}


@pytest.mark.parametrize(
    ("thing", "position"),
    [
        ({"shape": "plane", "normal": [0, 0, 5]}, (0.01, 0.0, -0.002)),
        ({"shape": "sphere", "center_m": [0, 0, -0.02], "radius_m": 0.02}, (0.0, 0.0, -0.002)),
        ({"shape": "sphere", "center_m": [0, 0, 0.05], "radius_m": 0.05, "side": "inside"}, (0.0, 0.0, -0.002)),
        (BOX, (0.0, 0.0, -0.002)),
        (BOX | {"size_m": [0.1, 0.02, 0.02], "rotation_deg": [0, 0, 90]}, (0.0, 0.04, -0.002)),
        (BOX | {"center_m": [0, 0, 0.05], "size_m": [0.1, 0.1, 0.1], "side": "inside"}, (0.0, 0.0, -0.002)),
        ({"shape": "height_field", "heights_m": [[0, 0], [0, 0]], "spacing_m": 0.1}, (0.0, 0.0, -0.002)),
        ({"shape": "plane", "carve": [BOX | {"center_m": [0, 0, 0]}]}, (0.0, 0.0, -0.012)),
        ({"shape": "plane", "carve": [{"shape": "sphere", "center_m": [0, 0, 0], "radius_m": 0.01}]}, (0, 0, -0.012)),
        (
            BOX
            | {"center_m": [0, 0, 0], "size_m": [0.1, 0.1, 0.1], "carve": [{"shape": "plane", "normal": [0, 0, -1]}]},
            (0.0, 0.0, -0.002),
        ),
    ],
)
def test_every_shape_and_cut_pushes_as_written(thing: dict[str, Any], position: tuple[float, float, float]) -> None:
    """2 mm of depth against 500 N/m."""
    assert force_of([thing | {"stiffness_n_m": 500}], position) == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
