"""The greeting of a page, for every shipped configuration."""

import json
from pathlib import Path

import pytest

from tests.system.systems import CONFIGS
from tests.watching.sources import description
from weberlink.watching.hello import MOST_HEIGHTS, drawn, hello


def test_greeting_has_scene_settings_and_choices() -> None:
    told = hello("7", {"master": description("master"), "slave": None})
    assert told["scene"][0]["shape"] == "plane" and told["scene"][0]["normal"] == [0.0, 0.0, 1.0]
    assert told["scene"][1] == {
        "shape": "sphere",
        "center_m": [0.0, 0.0, -0.045],
        "radius_m": 0.05,
        "inside": False,
        "stiffness_n_m": 500.0,
        "carve": [],
    }
    assert told["predictors"] == ["zoh", "linear", "plane", "sphere", "hybrid"]
    assert told["settings"] == {"weber": 0.1, "predictor": "hybrid"}
    assert (told["rate_hz"], told["readonly"]) == (1000.0, False)
    assert told["states"]["4"] == "engaged" and told["faults"]["1"] == "silence"
    assert set(told["sides"]) == {"master", "slave"} and told["present"] == ["master", "slave"]


def test_greeting_names_file_drivers_and_sides() -> None:
    master = description("master") | {"file": "/etc/weberlink/loopback.yaml", "name": "ann@desk"}
    slave = description("slave")
    slave["system"]["link"]["names"]["slave"] = "arm-2"
    assert hello("7", {"master": master, "slave": slave | {"name": "arm-2"}})["names"] == {
        "file": "loopback.yaml",
        "device": "operator",
        "robot": "point",
        "peer": "127.0.0.1:0",
        "master": "ann@desk",
        "slave": "arm-2",
    }
    assert hello("7", {"slave": slave})["names"]["slave"] == "arm-2"
    heard = hello("7", {"slave": slave | {"peer": {"name": "bob@lab"}}})["names"]
    assert (heard["master"], heard["slave"]) == ("bob@lab", "arm-2")
    assert set(hello("7", {"slave": None})["names"].values()) == {None}


def test_greeting_names_the_peer_of_a_found_path() -> None:
    master = description("master", "anywhere.yaml")
    assert hello("7", {"master": master})["names"]["peer"] is None
    heard = master | {"peer": {"name": "arm@lab"}}
    assert hello("7", {"master": heard})["names"]["peer"] == "arm@lab"
    master["system"]["link"]["peer"] = "arm"
    assert hello("7", {"master": heard})["names"]["peer"] == "arm"


def test_unknown_session_is_read_only() -> None:
    told = hello("7", {"slave": None})
    assert told["readonly"] and told["changes"] == []


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_scene_can_be_drawn(path: Path) -> None:
    if "key_file" in path.read_text():
        pytest.skip("needs a key")
    told = hello("7", {"slave": description("slave", path.name)})
    json.dumps(told, allow_nan=False)
    for shape in told["scene"]:
        assert shape["shape"] in ("plane", "sphere", "box", "height_field")
        assert shape.get("heights_m", ()) is not None


def test_large_height_field_is_thinned_in_place() -> None:
    heights = [[float(100 * row + column) for column in range(400)] for row in range(201)]
    scene = [{"shape": "height_field", "center_m": [1.0, 2.0, 0.0], "heights_m": heights, "spacing_m": 0.01}]
    (shape,) = drawn(scene)
    rows, columns = len(shape["heights_m"]), len(shape["heights_m"][0])
    assert max(rows, columns) <= MOST_HEIGHTS
    step = round(shape["spacing_m"] / 0.01)
    for row, column in ((0, 0), (rows - 1, columns - 1)):
        assert shape["heights_m"][row][column] == heights[row * step][column * step]
        x = shape["center_m"][0] + (column - (columns - 1) / 2) * shape["spacing_m"]
        assert x == pytest.approx(1.0 + (column * step - 399 / 2) * 0.01)
        y = shape["center_m"][1] + (row - (rows - 1) / 2) * shape["spacing_m"]
        assert y == pytest.approx(2.0 + (row * step - 200 / 2) * 0.01)


def test_heights_of_a_file_that_is_gone_are_unknown(tmp_path: Path) -> None:
    (tmp_path / "field.csv").write_text("0,1\n2,3\n")
    scene = [{"shape": "height_field", "csv": str(tmp_path / "field.csv"), "spacing_m": 0.01}]
    assert drawn(scene)[0]["heights_m"] == [[0.0, 1.0], [2.0, 3.0]]
    (tmp_path / "field.csv").unlink()
    assert drawn(scene)[0]["heights_m"] is None
