"""Two hosts behind NATs find a path by the real relay and mailbox; `plugins.anywhere.trials` does the rest."""

from os import urandom
from pathlib import Path
from typing import Any

import pytest

from plugins.anywhere.tests import FILE
from plugins.anywhere.tests.namespaces import needs_testbed
from plugins.anywhere.tests.testbed import CONE, MAILBOX_URL, NONE, SECRET, SYMMETRIC, Internet
from tests.program import ENGAGED, PATIENT, Program
from tests.wait import until
from weberlink.protocol.keys import Right
from weberlink.session import description
from weberlink.telemetry.ring import default_path
from weberlink_anywhere.peers import KEY_BYTES, Peer, PeerStore

pytestmark = [needs_testbed, pytest.mark.realtime]


@pytest.fixture
def arguments(tmp_path: Path) -> dict[str, list[Any]]:
    """Of a command, by side; the two know each other as anna and robot. The key of `remote`, called pedal, may stop."""
    secret, key, made = tmp_path / "turn.secret", urandom(KEY_BYTES), {}
    secret.write_text(SECRET)
    secret.chmod(0o600)
    for side, name, own in (("master", "robot", "anna"), ("slave", "anna", "robot"), ("remote", "robot", "pedal")):
        store = PeerStore(tmp_path / side)
        if side == "remote":
            key = urandom(KEY_BYTES)
            pedal = Peer("pedal", "pedal", "robot", "master", key, MAILBOX_URL, right=Right.STOP)
            PeerStore(tmp_path / "slave").add(pedal)
        store.add(Peer(name, name, own, "master" if side == "slave" else "slave", key, MAILBOX_URL))
        finder = {"peer_store": store.folder, "turn.secret_file": secret, "mailbox": MAILBOX_URL}
        placed = [f"link.finder.{name}={value}" for name, value in finder.items()]
        sets = [word for each in placed for word in ("--set", each)]
        made[side] = [side, FILE, *sets, *PATIENT]
    return made


def path_of(program: Program, side: str) -> dict[str, Any]:
    described = description.read(default_path(f"{program.pid}-{side}"))
    assert described is not None
    (path,) = described["paths"]
    found: dict[str, Any] = path
    return found


@pytest.mark.parametrize(
    ("robot", "operator", "route"),
    [
        (CONE, CONE, "punched"),
        pytest.param(NONE, NONE, "direct", marks=pytest.mark.hunt),
        pytest.param(SYMMETRIC, CONE, "relayed", marks=pytest.mark.hunt),
    ],
)
def test_a_session_behind_two_nats_survives_a_lost_mapping_and_is_stopped_from_beside_it(
    internet: Internet, arguments: dict[str, list[Any]], robot: str, operator: str, route: str
) -> None:
    lab, home = internet.home(robot), internet.home(operator)
    with (
        Program(*arguments["slave"], prefix=lab.prefix) as slave,
        Program(*arguments["master"], prefix=home.prefix) as master,
    ):
        ends = master.engaged("master"), slave.engaged("slave")
        until(lambda: path_of(master, "master")["route"] == path_of(slave, "slave")["route"] == route, "the route")
        if operator != NONE:
            home.first.space.forget_connections()
            until(lambda: path_of(master, "master")["changes"] > 0, "another path")
        heard = [end.last["datagrams_received"] for end in ends]
        until(
            lambda: all(
                end.last["state"] == ENGAGED and end.last["datagrams_received"] > before + 5
                for end, before in zip(ends, heard, strict=True)
            ),
            "the session to go on",
        )
        with Program(*arguments["remote"], "--stop", prefix=home.prefix) as pedal:
            assert pedal.finish()[0] == 0
        assert "emergency stop by pedal" in slave.finish()[1]
