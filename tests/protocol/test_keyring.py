"""A slave with a key for each of several masters: each opens sessions under its own name alone."""

from random import Random

import pytest

from tests.protocol.harness import Pair
from weberlink.protocol import Connected, DropReason, Refused, State
from weberlink.protocol.psk import Keyring, PresharedKey

KEYS = {name: Random(name).randbytes(32) for name in ("ann@desk", "bob@desk")}
STRANGER = Random("eve@desk").randbytes(32)


def pair(name: str, key: bytes) -> Pair:
    ends = {"name": name, "security": PresharedKey(key)}
    return Pair(master=ends, slave={"name": "robot", "security": Keyring(KEYS)}).connect()


@pytest.mark.parametrize("name", KEYS)
def test_every_known_master_is_served(name: str) -> None:
    served = pair(name, KEYS[name]).run(0.2)
    assert served.slave.endpoint.state is State.ENGAGED
    assert served.slave.endpoint.peer_name == name


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("bob@desk", KEYS["ann@desk"]),
        ("ann@desk", STRANGER),
        ("eve@desk", STRANGER),
        ("eve@desk", KEYS["ann@desk"]),
    ],
)
def test_a_key_opens_no_session_under_another_name(name: str, key: bytes) -> None:
    called = pair(name, key).run(0.5)
    assert not called.slave.of(Connected)
    assert not called.master.of(Connected) and not called.master.of(Refused)
    assert set(called.slave.faults()) == {DropReason.UNPROVEN}
