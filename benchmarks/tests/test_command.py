"""The commands as their user runs them."""

import socket

import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from tests.program import Program


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (("--duration", "0.5"), "--duration"),
        (("no-such.yaml",), "no-such.yaml"),
        (("--set", "rate_hz=500"), "rate_hz"),
        (("--set", "nonsense=1"), "nonsense"),
    ],
)
def test_a_wrong_argument_is_one_line_that_names_it(arguments: tuple[str, ...], field: str) -> None:
    ended = CliRunner().invoke(app, ["bench", *arguments])
    assert (ended.exit_code, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert field in ended.stderr


@pytest.mark.realtime
def test_a_failed_measurement_has_status_1() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        options = [f'--set=link.{end}="{address}"' for end in ("listen", "slave")]
        with Program("--quick", *options, module="benchmarks") as program:
            status, said, complaints = program.finish()
    assert (status, said, address in complaints, "Traceback" in complaints) == (1, "", True, False)
