"""Wrong arguments of `weberlink monitor` are one line each."""

import pytest
from typer.testing import CliRunner

from weberlink.cli import app


def complaint(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["monitor", *map(str, arguments)])
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    return result.stderr


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1"])
def test_public_address_needs_the_public_option(address: str) -> None:
    assert "--public" in complaint("--listen", address)


def test_port_must_be_in_range() -> None:
    complaint("--port", 70_000)
