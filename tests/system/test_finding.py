"""A daemon and the process that finds its paths: what it is asked, what is published, and what its end means."""

import json
import os
import signal
from contextlib import suppress
from pathlib import Path

import pytest

from tests.program import Program, document
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.anywhere.peers import KEY_BYTES, Peer, PeerStore
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.aio.paths import FINDER_ENDED
from weberlink.system import description
from weberlink.system.composition.acquaintance import acquaintance, finder_order
from weberlink.system.configuration import MASTER, SLAVE, Configuration, load

FILE = CONFIGS / "anywhere.yaml"
FINDER = b"weberlink.anywhere.finder"
OPERATOR = Peer("lab", "operator", "robot", "master", bytes(KEY_BYTES))
ROBOT = Peer("arm", "robot", "operator", "slave", bytes(KEY_BYTES))


@pytest.fixture
def store(tmp_path: Path) -> PeerStore:
    """One operator and one robot that know each other."""
    made = PeerStore(tmp_path / "peers")
    made.add(OPERATOR)
    made.add(ROBOT)
    return made


def loaded(store: PeerStore, side: str, *overrides: str) -> Configuration:
    return load(FILE, [f"link.peer_store={store.folder}", *overrides], sides=[side])


def test_order_holds_what_the_file_says(store: PeerStore) -> None:
    pytest.importorskip("aioice")
    configuration = loaded(store, MASTER, "link.paths=2", 'link.interfaces=["wlan0","usb0"]', "link.dscp=34")
    order = finder_order(configuration, MASTER, acquaintance(configuration, MASTER).peers, take_over=True)
    assert (order.side, order.peers, order.store) == (MASTER, ("arm",), str(store.folder))
    assert (order.mailbox, order.stun) == ("ws://relay.example:4000/v1", "relay.example:3478")
    assert (order.turn, order.turn_name) == ("relay.example:3478", "relay.example")
    assert (order.turn_secret_file, order.turn_credentials_file) == (str(FILE.parent / "turn.secret"), None)
    assert (order.paths, order.interfaces, order.dscp, order.take_over) == (2, ("wlan0", "usb0"), 34, True)


def test_description_names_paths_and_no_secrets(store: PeerStore, tmp_path: Path) -> None:
    ring = tmp_path / "ring"
    published = description.Description(ring, description.describe(loaded(store, MASTER), MASTER))
    published.publish({"name": "robot"}, [PathFacts(1, "relayed", "relay.example", "wlan0", "192.0.2.1:3478", dscp=0)])
    found = description.read(ring)
    assert found is not None
    assert found["peer"] == {"name": "robot"}
    (path,) = found["paths"]
    assert (path["place"], path["route"], path["via"], path["dscp"]) == (1, "relayed", "relay.example", 0)
    text = json.dumps(found)
    assert "turn.secret" not in text
    assert str(store.folder) not in text


def end_finder(program: Program) -> bool:
    """Kill the process that finds paths; whether it is gone, or the program has ended."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(FileNotFoundError, ProcessLookupError):
            parent = int((path.parent / "stat").read_text(errors="replace").rpartition(")")[2].split()[1])
            if FINDER in path.read_bytes() and parent in program.daemons():
                os.kill(int(path.parent.name), signal.SIGKILL)
                return True
    return not program.children()


@pytest.mark.realtime
def test_waiting_slave_fails_once_its_finder_has_ended(store: PeerStore) -> None:
    pytest.importorskip("aioice")
    overrides = (f"link.peer_store={store.folder}", "link.mailbox=ws://127.0.0.1:9/v1", "link.turn=null")
    settings = [word for override in overrides for word in ("--set", override)]
    with Program("slave", FILE, *settings, "--json", "-") as program:
        program.telemetry(SLAVE)
        until(lambda: end_finder(program), "the finder")
        status, output, _ = program.finish()
    assert status == 1
    assert FINDER_ENDED in document(output)["outcome"]
