"""Whom a side meets: the known peers that its file asks for."""

from pathlib import Path
from random import Random
from typing import Literal

import pytest

from plugins.anywhere.tests import FILE
from weberlink.protocol.keyring import Keyring
from weberlink.protocol.psk import PresharedKey
from weberlink.system.configuration import ConfigurationError, load
from weberlink.system.finders import finder_of
from weberlink_anywhere.peers import Peer, PeerStore


def peer(label: str, role: Literal["master", "slave"], own: str = "here") -> Peer:
    return Peer(label, f"{label}'s own name", own, role, Random(label).randbytes(32))


@pytest.fixture
def store(tmp_path: Path) -> PeerStore:
    return PeerStore(tmp_path / "peers")


def known(store: PeerStore, side: str, *overrides: str):  # type: ignore[no-untyped-def]
    file = load(FILE, [f"link.finder.peer_store={store.folder}", *overrides], [side])
    return finder_of(file, side)


def test_master_calls_the_only_robot_that_it_knows(store: PeerStore) -> None:
    store.add(peer("arm", "slave"))
    store.add(peer("ann", "master"))  # this host has a robot too
    found = known(store, "master")
    assert isinstance(found.security, PresharedKey)
    assert (found.own, found.expects) == ("here", "arm's own name")


def test_slave_waits_for_all_operators(store: PeerStore) -> None:
    for label in ("ann", "bob"):
        store.add(peer(label, "master"))
    found = known(store, "slave")
    assert isinstance(found.security, Keyring)
    assert [each.label for each in found.peers] == ["ann", "bob"] and found.expects == ""
    assert known(store, "slave", "link.finder.peer=bob").expects == "bob's own name"


@pytest.mark.parametrize(
    ("labels", "overrides", "complaint"),
    [
        ((), (), "no slave is known; pair with --invite and --join"),
        (("arm", "leg"), (), "several robots are known, say which: arm, leg"),
        (("arm",), ("link.finder.peer=leg",), "there is no peer 'leg'; known: ann, arm"),
        (("arm",), ("link.finder.peer=ann",), "ann is a master, and so is this side"),
    ],
)
def test_unclear_peer_is_named(
    store: PeerStore, labels: tuple[str, ...], overrides: tuple[str, ...], complaint: str
) -> None:
    store.add(peer("ann", "master"))
    for label in labels:
        store.add(peer(label, "slave"))
    with pytest.raises(ConfigurationError, match=complaint):
        known(store, "master", *overrides)


def test_peers_that_know_another_name_of_this_host_are_named(store: PeerStore) -> None:
    store.add(peer("ann", "master", own="arm:47000"))
    store.add(peer("bob", "master", own="arm:47001"))
    with pytest.raises(ConfigurationError, match="different names: arm:47000, arm:47001"):
        known(store, "slave")
    assert known(store, "slave", "link.finder.peer=bob").own == "arm:47001"
