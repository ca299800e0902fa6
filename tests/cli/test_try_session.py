"""Arguments of `weberlink try`, and where its page is served."""

import importlib.util
import socket
from collections.abc import Iterator

import pytest

from tests.cli.test_cli import complaint, run
from weberlink.apps.monitor import address
from weberlink.installation import install_line


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_given_port_in_use_is_one_line(taken_port: int) -> None:
    assert f"port {taken_port} is in use" in complaint(run("try", "--port", taken_port), 1)


def test_missing_extra_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    hidden = lambda name, package=None: None if name == "aiohttp" else find(name, package)  # noqa: E731
    monkeypatch.setattr("weberlink.system.configuration.extras.find_spec", hidden)
    assert install_line("monitor") in complaint(run("try"))


def test_usual_port_in_use_gives_way_to_another(taken_port: int) -> None:
    with address.bind("127.0.0.1", taken_port, or_any=True) as listening:
        port = listening.getsockname()[1]
        assert port != taken_port
        assert address.url(listening, "secret") == f"http://127.0.0.1:{port}/#key=secret"


def test_address_for_other_hosts_has_the_key() -> None:
    with address.bind("127.0.0.1", 0) as listening:
        assert address.public_url(listening, "secret") == address.url(listening, "secret")
    with address.bind("0.0.0.0", 0) as listening:
        assert address.url(listening, "secret").startswith("http://127.0.0.1:")
        assert "//0.0.0.0" not in address.public_url(listening, "secret")
