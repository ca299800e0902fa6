"""A path finder of another distribution: its key, its names, the process that finds paths, and its secrets."""

import socket
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import pytest
from pydantic import BaseModel

from tests.protocol.harness import make_endpoint
from tests.session.systems import CONFIGS
from weberlink.cli.sessions import acquainted
from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError, load
from weberlink.config.finders import PathFinder, finder_of, finding
from weberlink.config.loading import Part
from weberlink.protocol import Role
from weberlink.protocol.aio import UdpShell
from weberlink.protocol.aio.udp import MakePaths, Paths
from weberlink.protocol.psk import PresharedKey
from weberlink.session.composition.link import build_security

FILE = CONFIGS / "loopback.yaml"
PROGRAM = """
import socket, sys

with socket.socket(fileno=int(sys.argv[2])) as end:
    end.send(sys.argv[1].encode())
    end.recv(1)
"""


class Found(Paths):
    """Paths with the socket to the process that finds them."""

    def __init__(self, *arguments: Any, end: socket.socket) -> None:
        super().__init__(*arguments)
        self.end = end


class Options(BaseModel):
    peer: str = "robot"
    finds: bool = True


class Finder:
    Options = Options

    def __init__(self, options: Options, configuration: Configuration, side: str) -> None:
        self.security = PresharedKey(bytes(32))
        self.own, self.expects = side, options.peer

    def process(self, *, take_over: bool, stream: str = "") -> tuple[str, ...]:
        return "finder_of_a_stranger", f"{self.expects} {take_over}"

    def paths(self, end: socket.socket) -> MakePaths:
        return partial(Found, end=end)

    @staticmethod
    def finds_path(options: Options) -> bool:
        return options.finds


def configuration(side: str, **options: Any) -> Configuration:
    return replace(load(FILE, (), [side]), finder=Part(Finder, Options(**options)))


def test_a_process_finds_paths_and_ends_with_the_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "finder_of_a_stranger.py").write_text(PROGRAM)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    asked = configuration(MASTER)
    with finding(asked, finder_of(asked, MASTER), take_over=True) as make:
        shell = UdpShell(make_endpoint(Role.RESPONDER), now=monotonic, paths=make)
        found = shell._paths
        assert isinstance(found, Found) and not found.end.getblocking()
        found.end.setblocking(True)
        assert found.end.recv(100) == b"robot True"


def test_the_finder_has_the_key_and_the_names_and_no_process_without_a_path_to_find() -> None:
    asked = configuration(SLAVE)
    found: PathFinder | None = finder_of(asked, SLAVE)
    assert found is not None and (found.own, found.expects) == (SLAVE, "robot")
    assert isinstance(build_security(asked), PresharedKey)
    assert finder_of(load(FILE), MASTER) is None
    for asked in (configuration(MASTER, finds=False), load(FILE)):
        with finding(asked, finder_of(asked, MASTER), take_over=False) as make:
            assert make is Paths


@pytest.mark.parametrize(
    ("side", "label", "pairs", "asked"),
    [(MASTER, "a", False, "--peer"), (SLAVE, None, True, "--invite"), (MASTER, None, True, "--join")],
)
def test_who_asks_for_a_peer_needs_a_finder(side: str, label: str | None, pairs: bool, asked: str) -> None:
    assert acquainted(FILE, (), side, None, pairs=False) == []
    with pytest.raises(ConfigurationError, match=f"{asked}: needs link.finder in the file"):
        acquainted(FILE, (), side, label, pairs=pairs)
