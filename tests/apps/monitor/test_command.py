"""Wrong arguments of `weberlink monitor` are one line each."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from weberlink.cli import app
from weberlink.protocol.keys import generate


def complaint(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["monitor", *map(str, arguments)])
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    return result.stderr


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1"])
def test_public_address_needs_the_public_option(address: str) -> None:
    assert "--public" in complaint("--listen", address)


@pytest.mark.parametrize("option", ["--share", "--from"])
def test_link_needs_key_and_address(option: str, tmp_path: Path) -> None:
    assert "weberlink keygen" in complaint(option, "127.0.0.1:1")
    assert f"{option}: must be host:port" in complaint(option, "127.0.0.1")
    assert "does not exist" in complaint(option, "127.0.0.1:1", "--key-file", tmp_path / "missing")
    generate(tmp_path / "key")
    (tmp_path / "key").chmod(0o644)
    assert "chmod 600" in complaint(option, "127.0.0.1:1", "--key-file", tmp_path / "key")


def test_key_without_link_is_an_error(tmp_path: Path) -> None:
    assert "--share or --from" in complaint("--key-file", tmp_path / "key")


def test_port_must_be_in_range() -> None:
    complaint("--port", 70_000)
