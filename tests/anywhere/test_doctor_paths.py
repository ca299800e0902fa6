"""doctor --link over paths that were found: behind two NATs, through the relay, and where UDP is blocked."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.anywhere.namespaces import SERVER_NAME, needs_testbed
from tests.anywhere.testbed import BLOCKED, CONE, MAILBOX_PORT, SECRET, SYMMETRIC, TURN_PORT, Home, Internet
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.anywhere.peers import Peer, PeerStore

pytestmark = [
    needs_testbed,
    pytest.mark.hunt,
    pytest.mark.realtime,
    pytest.mark.skipif(find_spec("weberlink.anywhere.finder") is None, reason="nothing finds paths here"),
]
PROGRAM = (sys.executable, "-m", "weberlink")
MAILBOX = f"ws://{SERVER_NAME}:{MAILBOX_PORT}/v1"


@pytest.fixture(scope="module")
def internet() -> Iterator[Internet]:
    with Internet() as internet:
        internet.start_relay()
        internet.start_mailbox()
        yield internet


def command(folder: Path, side: str) -> list[str]:
    """The file and its settings, for a side whose peers are in a folder of its own."""
    secret = folder / "turn.secret"
    secret.touch(mode=0o600)
    secret.write_text(SECRET)
    settings = (
        f"link.peer_store={folder / side}",
        f"link.turn={{server: '{SERVER_NAME}:{TURN_PORT}', secret_file: {secret}}}",
        "link.silence_ms=2000",
    )
    return [str(CONFIGS / "anywhere.yaml"), *(word for each in settings for word in ("--set", each))]


@contextmanager
def waiting(lab: Home, folder: Path) -> Iterator[None]:
    """A slave that waits for its operator."""
    key = os.urandom(32)
    for side, label, own, role in (("slave", "hand", "arm@lab", "master"), ("master", "robot", "me@home", "slave")):
        name = "me@home" if role == "master" else "arm@lab"
        PeerStore(folder / side).add(Peer(label, name, own, role, key, MAILBOX))  # type: ignore[arg-type]
    slave = subprocess.Popen(
        [*lab.prefix, *PROGRAM, "slave", *command(folder, "slave"), "--json", str(folder / "slave.json")],
        stdout=subprocess.DEVNULL,
    )
    try:
        until(lambda: slave.poll() is not None or _finds(lab), "the slave to start its finder")
        yield
    finally:
        slave.terminate()
        slave.wait(30)


def _finds(lab: Home) -> bool:
    """Whether a process that finds paths runs on this host."""
    pids = subprocess.run(["ip", "netns", "pids", lab.space.name], capture_output=True, text=True, check=True)
    commands = (Path(f"/proc/{pid}/cmdline") for pid in pids.stdout.split())
    return any(b"weberlink.anywhere.finder" in each.read_bytes() for each in commands if each.exists())


def measured(home: Home, folder: Path) -> dict[str, Any]:
    doctor = [*home.prefix, *PROGRAM, "doctor", *command(folder, "master"), "--link", "robot", "--duration", "2"]
    done = subprocess.run([*doctor, "--json", "-"], capture_output=True, text=True, check=False, timeout=120)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize(("lab", "home", "route"), [(CONE, CONE, "punched"), (CONE, SYMMETRIC, "relayed")])
def test_found_path_is_measured(internet: Internet, tmp_path: Path, lab: str, home: str, route: str) -> None:
    with waiting(internet.home(lab), tmp_path):
        found = measured(internet.home(home), tmp_path)
    assert found["paths"][0]["route"] == route
    assert found["nat"]["needs_relay"] is (home == SYMMETRIC)
    assert found["link"]["answers"] > 200
    at_rest = json.loads((tmp_path / "slave.json").read_text())
    assert at_rest["position"]["packets"] == at_rest["force"]["packets"] == 0


def test_blocked_udp_is_the_only_problem(internet: Internet, tmp_path: Path) -> None:
    with waiting(internet.home(CONE), tmp_path):
        found = measured(internet.home(BLOCKED), tmp_path)
    (problem,) = (each for each in found["findings"] if each["grade"] == "problem")
    assert problem["found"].startswith("UDP is blocked between here and relay.example:3478")
