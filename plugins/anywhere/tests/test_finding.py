"""A daemon and the process that finds its paths: what it is asked, what is published, and what its end means."""

import json
import os
import signal
from contextlib import suppress
from pathlib import Path

import pytest

from plugins.anywhere.tests import FILE
from tests.program import Program, document
from tests.test_child_process import executed
from tests.wait import until
from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.hand_over import PathFacts, PathNews
from weberlink.protocol.aio.paths import FINDER_ENDED
from weberlink.system import description
from weberlink.system.configuration import MASTER, SLAVE, Configuration, load
from weberlink.system.finders import finder_of, running
from weberlink_anywhere.order import FinderOrder, PairingOrder
from weberlink_anywhere.pair import start
from weberlink_anywhere.path_finder import Anywhere
from weberlink_anywhere.peers import KEY_BYTES, Peer, PeerStore

__all__ = ["executed"]
NOWHERE = "ws://127.0.0.1:1/v1"
FINDER = b"weberlink_anywhere.finder"
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
    return load(FILE, [f"link.finder.peer_store={store.folder}", *overrides], sides=[side])


def test_order_holds_what_the_file_says(store: PeerStore) -> None:
    configuration = loaded(
        store, MASTER, "link.finder.paths=2", 'link.finder.interfaces=["wlan0","usb0"]', "link.dscp=34"
    )
    finder = finder_of(configuration, MASTER)
    assert isinstance(finder, Anywhere)
    order = finder.order(take_over=True)
    assert (order.side, order.peers, order.store) == (MASTER, ("arm",), str(store.folder))
    assert (order.mailbox, order.stun) == ("ws://relay.example:4000/v1", "relay.example:3478")
    assert order.turn is not None and order.turn["server"] == "relay.example:3478"
    assert (order.turn["secret_file"], order.turn["credentials_file"]) == (str(FILE.parent / "turn.secret"), None)
    assert FinderOrder.from_json(order.to_json()) == order
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
    overrides = (
        f"link.finder.peer_store={store.folder}",
        "link.finder.mailbox=ws://127.0.0.1:9/v1",
        "link.finder.turn=null",
    )
    settings = [word for override in overrides for word in ("--set", override)]
    with Program("slave", FILE, *settings, "--json", "-") as program:
        program.telemetry(SLAVE)
        until(lambda: end_finder(program), "the finder")
        status, output, _ = program.finish()
    assert status == 1
    assert FINDER_ENDED in document(output)["outcome"]


@pytest.mark.usefixtures("executed")
def test_no_process_imports_from_the_working_directory(tmp_path: Path) -> None:
    order = FinderOrder("master", ("nobody",), str(tmp_path), NOWHERE)
    with running(("weberlink_anywhere.finder", order.to_json())) as end:
        end.setblocking(True)
        received = hand_over.receive(end)
    assert received is not None and isinstance(received[0], PathNews) and "nobody" in received[0].text
    pairing = start(PairingOrder("slave", "robot", str(tmp_path), NOWHERE))
    until(lambda: not pairing.running, "the refusal")
    assert NOWHERE in json.loads(pairing.end(1.0))["refused"]
