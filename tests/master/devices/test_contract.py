"""The contract that every device driver keeps, of the computed ones; those of boards are beside the emulators."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from weberlink.master.devices import BUILT_IN, DEVICES
from weberlink.testing.devices import DeviceBench, DeviceContract, armed
from weberlink.testing.time import virtual_time

REACH = {"motion": "reach", "to_m": [0.2, 0, 0]}
REST = {"motion": "rest"}
TURN = {"motion": "turn", "turn_deg": [0, 0, 9]}


def test_every_computed_driver_is_tested() -> None:
    tested = {each.NAME for each in globals().values() if isinstance(each, type) and each.__name__.startswith("Test")}
    assert tested == {name for name in BUILT_IN if not hasattr(DEVICES.load(name), "plugged")}


class TestOperator(DeviceContract):
    NAME = "operator"
    REFUSED = (
        ({"script": [REACH]}, "script.0: expected motion within the workspace"),
        ({"script": [REST, {"motion": "press", "at_m": [0, 0, 0], "depth_m": 0.1}]}, "script.1"),
        ({"script": [{"motion": "reach", "to_m": [0, 0, 0], "duration_s": 0}]}, "duration_s"),
        ({"script": [{"motion": "slide", "points_m": [[0, 0, 0]]}]}, "points_m"),
        ({"wrist": {"stiffness_n_m_rad": 0}}, "wrist.stiffness_n_m_rad"),
        ({"wrist": {}, "script": [{"motion": "turn", "turn_deg": [0, 150, 150]}]}, "at most half a turn"),
        ({"script": [TURN]}, "script.0.turn_deg: only a hand with a wrist"),
        ({"script": [REST, {**TURN, "motion": "reach", "to_m": [0, 0, 0]}]}, "script.1.turn_deg"),
        ({"home_m": [0.0, 0.0, 0.0601]}, "home_m"),
    )
    TAKEN = (
        {"home_m": [0.0, 0.0, 0.06], "script": [{**REACH, "to_m": [0.06, -0.06, 0.06]}]},
        {"wrist": {}, "script": [{"motion": "turn", "turn_deg": [0, 0, -180]}]},
    )

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        yield DeviceBench(armed("operator", **options), virtual_time())


class TestReplay(DeviceContract):
    NAME = "replay"
    REFUSED = (
        ({"axes": "+x+y+y"}, "axes"),
        ({"trace": "nowhere.csv"}, "nowhere.csv: not found"),
        ({"scale": 100.0}, "trace: .* beyond the workspace"),
    )

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        path = folder / "circle.csv"
        rows = [f"{i * 0.01},{0.001 * (i % 7)},{0.0005 * i},{-0.0001 * i},0,0,0" for i in range(101)]
        path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
        yield DeviceBench(armed("replay", trace=path, **options), virtual_time(), options={"trace": path})
