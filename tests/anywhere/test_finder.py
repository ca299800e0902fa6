"""Two finders in two namespaces, with the real relay and mailbox, each with a stand-in for its daemon."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from os import urandom
from pathlib import Path
from time import monotonic

import pytest

from tests.anywhere.daemon_end import DaemonEnd
from tests.anywhere.namespaces import SERVER_NAME, needs_testbed
from tests.anywhere.testbed import BLOCKED, CONE, NONE, SECRET, SYMMETRIC, Home, Internet
from weberlink.anywhere.order import FinderOrder
from weberlink.anywhere.peers import KEY_BYTES, Peer, PeerStore
from weberlink.protocol.aio.hand_over import PathLost

pytestmark = [needs_testbed, pytest.mark.realtime]
RELAY = "our relay"
Meet = Callable[..., tuple[DaemonEnd, DaemonEnd]]


@pytest.fixture(scope="module")
def internet() -> Iterator[Internet]:
    with Internet() as internet:
        internet.start_relay()
        internet.start_mailbox()
        yield internet


@pytest.fixture
def orders(tmp_path: Path) -> dict[str, FinderOrder]:
    """By side; the two know each other as anna and robot."""
    secret = tmp_path / "turn.secret"
    secret.write_text(SECRET)
    secret.chmod(0o600)
    made = {}
    key = urandom(KEY_BYTES)
    for side, name, own in (("master", "robot", "anna"), ("slave", "anna", "robot")):
        store = tmp_path / side
        PeerStore(store).add(Peer(name, name, own, "slave" if side == "master" else "master", key))
        made[side] = FinderOrder(
            side,
            (name,),
            str(store),
            f"ws://{SERVER_NAME}:4000/v1",
            stun=f"{SERVER_NAME}:3478",
            turn=f"{SERVER_NAME}:3478",
            turn_name=RELAY,
            turn_secret_file=str(secret),
        )
    return made


@pytest.fixture
def meet(orders: dict[str, FinderOrder]) -> Iterator[Meet]:
    """Starts master and slave in two homes."""
    with ExitStack() as stack:

        def start(master: Home, slave: Home, paths: int = 1) -> tuple[DaemonEnd, DaemonEnd]:
            waiting = stack.enter_context(DaemonEnd(replace(orders["slave"], paths=paths), slave.prefix))
            calling = stack.enter_context(DaemonEnd(replace(orders["master"], paths=paths), master.prefix))
            return calling, waiting

        yield start


def exchanges(ends: tuple[DaemonEnd, DaemonEnd], count: int = 200) -> bool:
    """Both ends hear the other one so often."""
    for end in ends:
        end.wait_for_path()
    for end in ends:
        end.wait_for_datagrams(count)
    return True


def test_session_behind_two_nats_survives_lost_mapping(internet: Internet, meet: Meet) -> None:
    home, lab = internet.home(CONE), internet.home(CONE)
    ends = meet(home, lab)
    assert exchanges(ends)
    assert {end.paths[1].route for end in ends} == {"punched"}
    home.first.forget()
    for end in ends:
        end.wait_for_path(2)
    assert exchanges(ends)


@pytest.mark.hunt
@pytest.mark.parametrize(
    ("one", "other", "routes"),
    [
        (NONE, NONE, {"direct"}),
        (NONE, CONE, {"punched"}),
        (CONE, NONE, {"punched"}),
        (SYMMETRIC, NONE, {"punched"}),
        (SYMMETRIC, CONE, {"relayed"}),
        (SYMMETRIC, SYMMETRIC, {"relayed"}),
    ],
)
def test_each_pair_of_nats_exchanges_datagrams(
    internet: Internet, meet: Meet, one: str, other: str, routes: set[str]
) -> None:
    ends = meet(internet.home(one), internet.home(other))
    assert exchanges(ends, 1000)
    assert {end.paths[1].route for end in ends} == routes
    if routes == {"relayed"}:
        assert RELAY in {end.paths[1].via for end in ends}
        assert any(end.paths[1].channel is not None for end in ends)


@pytest.mark.hunt
@pytest.mark.parametrize("blocked", [0, 1])
def test_blocked_udp_is_one_final_line(internet: Internet, meet: Meet, blocked: int) -> None:
    homes = [internet.home(BLOCKED), internet.home(CONE)]
    calling, _ = meet(homes[blocked], homes[1 - blocked])
    calling.wait(lambda: calling.news)
    news = calling.news[-1]
    where = f"here and {SERVER_NAME}:3478" if blocked == 0 else "robot and its relay"
    assert news == ("robot", f"no path to robot: UDP is blocked between {where}", True)


@pytest.mark.hunt
@pytest.mark.parametrize("event", ["readdress", "renumber"])
@pytest.mark.parametrize("where", [0, 1])
def test_changed_address_of_either_end_is_followed(internet: Internet, meet: Meet, event: str, where: int) -> None:
    homes = [internet.home(CONE), internet.home(CONE)]
    ends = meet(*homes)
    assert exchanges(ends)
    getattr(homes[where].first, event)()
    for end in ends:
        end.wait_for_path(2)
    assert exchanges(ends)


@pytest.mark.hunt
def test_new_path_in_session_loses_no_datagram(internet: Internet, meet: Meet) -> None:
    home = internet.home(CONE)
    calling, waiting = meet(home, internet.home(CONE))
    assert exchanges((calling, waiting))
    firsts = [end.sent for end in (calling, waiting)]
    home.space.ip("addr add 192.168.1.77/24 dev wifi")
    for end in (calling, waiting):
        end.wait_for_path(2)
    assert exchanges((calling, waiting))
    last = [end.sent - 100 for end in (calling, waiting)]
    assert waiting.missed(firsts[0], last[0]) == 0
    assert calling.missed(firsts[1], last[1]) == 0


@pytest.mark.hunt
def test_one_of_two_paths_cut_loses_no_datagram(internet: Internet, meet: Meet) -> None:
    home = internet.home(CONE, second=SYMMETRIC)
    ends = meet(home, internet.home(CONE), 2)
    for end in ends:
        end.wait_for_path(2)
    assert [path.interface for path in ends[0].paths.values()] == ["wifi", "phone"]
    assert exchanges(ends)
    firsts = [end.sent for end in ends]
    home.first.set_silent(True)
    assert exchanges(ends, 1000)
    assert [ends[1 - i].missed(firsts[i], firsts[i] + 900) for i in (0, 1)] == [0, 0]


@pytest.mark.hunt
def test_silent_one_of_two_paths_is_found_again(internet: Internet, meet: Meet) -> None:
    home = internet.home(CONE, second=SYMMETRIC)
    ends = meet(home, internet.home(CONE), 2)
    for end in ends:
        end.wait_for_path(2)
    assert exchanges(ends)
    home.first.set_silent(True)
    for end in ends:
        (silent,) = (number for number, path in end.paths.items() if path.place == 0)
        end.tell_silent(silent)
        end.wait(lambda end=end, silent=silent: PathLost(silent) in end.lost)  # type: ignore[misc]
    home.first.set_silent(False)
    for end in ends:
        end.wait(lambda end=end: {path.place for path in end.paths.values()} == {0, 1})  # type: ignore[misc]
    assert exchanges(ends, 1000)


@pytest.mark.hunt
def test_session_outlives_mailbox(orders: dict[str, FinderOrder]) -> None:
    with ExitStack() as stack:
        other = stack.enter_context(Internet())
        other.start_relay()
        mailbox = other.start_mailbox()
        waiting = stack.enter_context(DaemonEnd(orders["slave"], other.home(CONE).prefix))
        ends = stack.enter_context(DaemonEnd(orders["master"], other.home(CONE).prefix)), waiting
        assert exchanges(ends)
        mailbox.stop()
        at = monotonic()
        assert exchanges(ends, 2000)
        assert max(end.longest_gap(at) for end in ends) < 0.5
        assert [len(end.found) for end in ends] == [1, 1]


@pytest.mark.hunt
def test_another_master_is_told_who_is_served(internet: Internet, orders: dict[str, FinderOrder]) -> None:
    key = urandom(KEY_BYTES)
    for side, label, name, own in (("master", "arm", "robot", "ben"), ("slave", "ben", "ben", "robot")):
        role = "slave" if side == "master" else "master"
        PeerStore(Path(orders[side].store)).add(Peer(label, name, own, role, key))
    lab, home, third = internet.home(CONE), internet.home(CONE), internet.home(CONE)
    with (
        DaemonEnd(replace(orders["slave"], peers=("anna", "ben")), lab.prefix) as waiting,
        DaemonEnd(orders["master"], home.prefix) as first,
    ):
        assert exchanges((first, waiting))
        with DaemonEnd(replace(orders["master"], peers=("arm",)), third.prefix) as second:
            second.wait(lambda: second.news)
            assert second.news[-1] == ("robot", "arm serves anna now; --take-over replaces it", True)
        with DaemonEnd(replace(orders["master"], peers=("arm",), take_over=True), third.prefix) as second:
            assert second.wait_for_path().peer == "robot"
