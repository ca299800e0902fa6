"""Whom a side meets, what its daemon asks of the process that finds paths, and what the end of that process means."""

import json
import os
import signal
from pathlib import Path
from typing import Literal

import pytest

from plugins.anywhere.tests import FILE
from tests.program import Program, child, document, weberlink
from tests.test_child_process import executed
from tests.wait import until
from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError, load
from weberlink.config.finders import finder_of, running
from weberlink.protocol.paths import LinkPath
from weberlink.protocol.psk import Keyring, PresharedKey
from weberlink.session import description
from weberlink_anywhere import hand_over
from weberlink_anywhere.found_paths import FINDER_ENDED
from weberlink_anywhere.hand_over import PathNews
from weberlink_anywhere.order import FinderOrder, PairingOrder
from weberlink_anywhere.pair import start
from weberlink_anywhere.path_finder import Anywhere
from weberlink_anywhere.peers import KEY_BYTES, Peer, PeerStore

__all__ = ["executed"]
NOWHERE = "ws://127.0.0.1:1/v1"


def peer(label: str, role: Literal["master", "slave"], own: str = "here") -> Peer:
    return Peer(label, f"{label}'s own name", own, role, bytes(KEY_BYTES))


@pytest.fixture
def store(tmp_path: Path) -> PeerStore:
    """One operator and one robot that this host knows."""
    made = PeerStore(tmp_path / "peers")
    made.add(peer("ann", "master"))
    made.add(peer("arm", "slave"))
    return made


def loaded(store: PeerStore, side: str, *overrides: str) -> Configuration:
    return load(FILE, [f"link.finder.{each}" for each in (f"peer_store={store.folder}", *overrides)], sides=[side])


def met(store: PeerStore, side: str, *overrides: str) -> Anywhere:
    found = finder_of(loaded(store, side, *overrides), side)
    assert isinstance(found, Anywhere)
    return found


def test_master_calls_the_only_robot_that_it_knows(store: PeerStore) -> None:
    found = met(store, MASTER)
    assert isinstance(found.security, PresharedKey)
    assert (found.own, found.expects) == ("here", "arm's own name")


def test_slave_waits_for_all_operators_or_for_one(store: PeerStore) -> None:
    store.add(peer("bob", "master", own="here:47001"))
    with pytest.raises(ConfigurationError, match="ann, bob know this host by different names: here, here:47001"):
        met(store, SLAVE)
    found = met(store, SLAVE, "peer=bob")
    assert (found.own, found.expects) == ("here:47001", "")
    store.remove("bob")
    store.add(peer("bob", "master"))
    found = met(store, SLAVE)
    assert isinstance(found.security, Keyring)
    assert [each.label for each in found.peers] == ["ann", "bob"] and found.expects == ""


@pytest.mark.parametrize(
    ("label", "overrides", "complaint"),
    [
        ("arm", (), "no slave is known; pair with --invite and --join"),
        ("", ("peer=leg",), "there is no peer 'leg'; known: ann, arm"),
        ("", ("peer=ann",), "ann is a master, and so is this side"),
    ],
)
def test_unclear_peer_is_named(store: PeerStore, label: str, overrides: tuple[str, ...], complaint: str) -> None:
    if label:
        store.remove(label)
    with pytest.raises(ConfigurationError, match=complaint):
        met(store, MASTER, *overrides)


def test_of_several_robots_one_must_be_named(store: PeerStore) -> None:
    store.add(peer("leg", "slave"))
    with pytest.raises(ConfigurationError, match="several robots are known, say which: arm, leg"):
        met(store, MASTER)
    assert met(store, MASTER, "peer=leg").expects == "leg's own name"
    told = weberlink("remote", FILE, "--peer", "nobody", "--set", f"link.finder.peer_store={store.folder}")
    assert (told.status, "there is no peer 'nobody'" in told.errors) == (2, True)


def test_order_holds_what_the_file_says(store: PeerStore) -> None:
    order = met(store, MASTER, "paths=2", 'interfaces=["wlan0","usb0"]').order(take_over=True)
    assert (order.side, order.peers, order.store) == (MASTER, ("arm",), str(store.folder))
    assert (order.mailbox, order.stun) == ("wss://relay.example:4000/v1", "relay.example:3478")
    assert order.turn is not None and order.turn["server"] == "relay.example:3478"
    assert (order.turn["secret_file"], order.turn["credentials_file"]) == (str(FILE.parent / "turn.secret"), None)
    assert (order.paths, order.interfaces, order.dscp, order.take_over) == (2, ("wlan0", "usb0"), 46, True)
    assert FinderOrder.from_json(order.to_json()) == order


def test_description_names_paths_and_no_secrets(store: PeerStore, tmp_path: Path) -> None:
    ring = tmp_path / "ring"
    published = description.Description(ring, description.describe(loaded(store, MASTER), MASTER))
    published.publish({"name": "robot"}, [LinkPath(1, "relayed", "relay.example", "wlan0", "192.0.2.1:3478", dscp=0)])
    found = description.read(ring)
    assert found is not None and found["peer"] == {"name": "robot"}
    (path,) = found["paths"]
    assert (path["place"], path["route"], path["via"], path["dscp"]) == (1, "relayed", "relay.example", 0)
    assert not any(secret in json.dumps(found) for secret in ("turn.secret", str(store.folder)))


def end_finder(program: Program) -> bool:
    """Kill the process that finds paths; whether it is gone, or the program has ended."""
    for finder in filter(None, (child(daemon, "weberlink_anywhere.finder") for daemon in program.daemons())):
        os.kill(finder, signal.SIGKILL)
        return True
    return not program.children()


@pytest.mark.realtime
def test_waiting_slave_fails_once_its_finder_has_ended(store: PeerStore) -> None:
    overrides = (f"peer_store={store.folder}", "mailbox=ws://127.0.0.1:9/v1", "turn=null")
    settings = [word for override in overrides for word in ("--set", f"link.finder.{override}")]
    with Program("slave", FILE, *settings, "--json", "-") as program:
        program.telemetry(SLAVE)
        until(lambda: end_finder(program), "the finder")
        status, output, _ = program.finish()
    assert status == 1
    assert FINDER_ENDED in document(output)["outcome"]


@pytest.mark.usefixtures("executed")
def test_no_process_imports_from_the_working_directory(tmp_path: Path) -> None:
    order = FinderOrder("master", ("nobody",), str(tmp_path), "here", NOWHERE)
    with running(("weberlink_anywhere.finder", order.to_json())) as end:
        end.setblocking(True)
        received = hand_over.receive(end)
    assert received is not None and isinstance(received[0], PathNews) and "nobody" in received[0].text
    pairing = start(PairingOrder("slave", "robot", str(tmp_path), NOWHERE))
    until(lambda: not pairing.running, "the refusal")
    assert NOWHERE in json.loads(pairing.end(1.0))["refused"]
