"""`weberlink bridge`: wrong arguments are refused in one line before anything is opened."""

import pytest
from typer.testing import CliRunner

from weberlink.cli import app


@pytest.mark.parametrize(
    ("arguments", "variables", "said"),
    [
        (["--domain", "233"], {}, "a ROS domain is 0 to 232, got 233"),
        ([], {"ROS_DOMAIN_ID": "-1"}, "a ROS domain is 0 to 232, got -1"),
        (["--connect", "localhost"], {}, "a Zenoh endpoint is like tcp/192.168.1.5:7447, got 'localhost'"),
        (["--rate", "inf"], {}, "must be a finite number"),
        (["--depth", "0"], {}, "--depth"),
    ],
)
def test_wrong_arguments_are_named(arguments: list[str], variables: dict[str, str], said: str) -> None:
    result = CliRunner().invoke(app, ["bridge", "ros2", *arguments], env=variables)
    assert result.exit_code == 2
    assert said in result.stderr


def test_a_session_that_cannot_be_opened_is_named(tmp_path: object) -> None:
    missing = f"{tmp_path}/none.json5"
    result = CliRunner().invoke(app, ["bridge", "ros2"], env={"ZENOH_SESSION_CONFIG_URI": missing})
    assert result.exit_code == 1
    assert "none.json5" in result.stderr and len(result.stderr.splitlines()) == 1
