"""A slave with a key for each of several masters: each opens sessions under its own name alone."""

from collections.abc import Mapping
from random import Random

import pytest

from tests.protocol.harness import Pair, Side, make_endpoint
from weberlink.protocol import Connected, DropReason, Refused, Role, State
from weberlink.protocol.keyring import Keyring
from weberlink.protocol.psk import PresharedKey

KEYS = {name: Random(name).randbytes(32) for name in ("ann@desk", "bob@desk")}
STRANGER = Random("eve@desk").randbytes(32)


def pair(name: str, key: bytes, keys: Mapping[str, bytes] = KEYS) -> Pair:
    return Pair(
        master={"name": name, "security": PresharedKey(key)}, slave={"name": "robot", "security": Keyring(keys)}
    ).connect()


def join(there: Pair, name: str, key: bytes) -> Side:
    end = make_endpoint(Role.INITIATOR, seed=77, name=name, security=PresharedKey(key))
    end.connect(there.now)
    there.guests.append(Side(end, ("192.0.2.9", 40_009)))
    return there.guests[-1]


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


def test_second_known_master_is_told_who_is_served() -> None:
    served = pair("ann@desk", KEYS["ann@desk"]).run(0.2)
    other = join(served, "bob@desk", KEYS["bob@desk"])
    served.run(0.3)
    assert "'ann@desk'" in other.refusal()
    assert served.master.endpoint.state is served.slave.endpoint.state is State.ENGAGED


def test_stranger_disturbs_no_session() -> None:
    served = pair("ann@desk", KEYS["ann@desk"]).run(0.2)
    stranger = join(served, "ann@desk", STRANGER)
    served.run(0.5)
    assert not stranger.of(Connected)
    assert served.master.endpoint.state is served.slave.endpoint.state is State.ENGAGED
