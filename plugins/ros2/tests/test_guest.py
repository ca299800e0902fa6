"""What is shipped: the file, the ROS package, and the command."""

from pathlib import Path

import pytest

from tests.program import weberlink
from weberlink_figures.message import SCHEMA_TEXT

FILE = Path(__file__).parents[1] / "configs" / "ros2.yaml"
PACKAGE = Path(__file__).parents[1] / "weberlink_msgs"


def test_the_file_is_live_alone() -> None:
    assert "ros2" in weberlink("simulate", FILE).complaint()


def test_the_message_of_the_ros_package_is_that_of_the_code() -> None:
    there = (PACKAGE / "msg" / "Tick.msg").read_text()
    assert there == SCHEMA_TEXT, "write weberlink_figures.message.SCHEMA_TEXT into it"
    assert "msg/Tick.msg" in (PACKAGE / "CMakeLists.txt").read_text()


@pytest.mark.parametrize(
    ("words", "config", "status", "field"),
    [(["--domain", 233], "", 2, "233"), (["--rate", "inf"], "", 2, "--rate"), ([], "/none.json5", 1, "none.json5")],
)
def test_what_the_bridge_refuses_is_one_line(
    words: list[object], config: str, status: int, field: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ZENOH_SESSION_CONFIG_URI", config)
    assert field in weberlink("bridge", "ros2", *words).complaint(status)
