"""What a key is good for: driving, watching or stopping, and until when."""

from random import Random

import pytest

from tests.protocol.harness import ENGAGED, MASTER, Pair, kind_of, make_endpoint, sent, states
from weberlink.protocol import Connected, DropReason, Endpoint, PeerClosed, Refused, Right, Role, State, StopAsked, Told
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.endpoint import WITHDRAWN
from weberlink.protocol.keys import HeldKey
from weberlink.protocol.psk import Keyring, PresharedKey
from weberlink.protocol.wire import Kind

KEYS = {right: Random(right).randbytes(32) for right in Right}
NAMES = {Right.DRIVE: "ann@desk", Right.WATCH: "wall@hall", Right.STOP: "pedal"}
HELD = [HeldKey(KEYS[right], right, NAMES[right]) for right in Right]
FILES_DIFFER = {"agreement": {"rate_hz": 500}}


def caller(right: Right, asks: Right, **changes: object) -> dict[str, object]:
    """Arguments of an end that holds the key of this right, and asks for something."""
    return {"name": NAMES[right], "security": PresharedKey(KEYS[right]), "asks": asks, **changes}


def pair_of(right: Right, asks: Right, **link: object) -> Pair:
    slave = {"name": "arm", "security": Keyring(HELD)}
    return Pair(master=caller(right, asks), slave=slave, **link).connect()  # type: ignore[arg-type]


def driven() -> Pair:
    pair = pair_of(Right.DRIVE, Right.DRIVE).run(0.2)
    assert states(pair) == ENGAGED
    return pair


def close_when_asked(pair: Pair, _now: float, _tick: int) -> None:
    slave = pair.slave
    if slave.of(StopAsked) and slave.endpoint.state is not State.CLOSED:
        slave.endpoint.close(slave.local(pair.now), "stopped")


@pytest.mark.parametrize("asks", Right)
@pytest.mark.parametrize("right", Right)
def test_a_key_is_good_for_what_its_line_says_and_one_that_may_drive_for_all(right: Right, asks: Right) -> None:
    pair = pair_of(right, asks, on_tick=close_when_asked).run(0.5)
    allowed = right in (Right.DRIVE, asks)
    assert bool(pair.slave.of(Connected)) is (allowed and asks is Right.DRIVE)
    assert bool(pair.slave.of(StopAsked)) is (allowed and asks is Right.STOP)
    assert bool(pair.master.of(Told)) is (allowed and asks is not Right.DRIVE)
    if not allowed:
        why = f"slave 'arm': the key of {NAMES[right]!r} is to {right}, and it asks to {asks}"
        assert pair.master.refusal() == why and pair.slave.endpoint.sessions == 0


def test_a_watcher_is_told_who_is_served_and_disturbs_nothing() -> None:
    pair = driven()
    pair.slave.endpoint.told = lambda: {"force_n": 1.5}
    before = len(pair.slave.events)
    watcher = pair.join(**caller(Right.WATCH, Right.WATCH, **FILES_DIFFER))
    pair.run(0.3)
    (told,) = watcher.of(Told)
    assert told == Told({"name": "arm", "state": "engaged", "serves": "ann@desk", "force_n": 1.5})
    assert states(pair) == ENGAGED and len(pair.slave.events) == before and not pair.master.of(PeerClosed)
    assert watcher.endpoint.state is State.CLOSED


@pytest.mark.parametrize("loss", [0.0, 0.5])
def test_a_stop_is_repeated_until_the_robots_end_has_stopped_and_is_answered_then(loss: float) -> None:
    for seed in range(10):
        link = Emulation(delay_s=0.02, jitter_s=0.01, loss=loss)
        pair = pair_of(Right.STOP, Right.STOP, link=link, seed=seed, on_tick=close_when_asked)
        pair.run(0.5 if loss == 0.0 else 5.0)
        assert pair.slave.endpoint.state is State.CLOSED
        assert pair.master.of(Told) or loss  # of three answers all may be lost
        answers = [at for at, side, data in pair.tap if side is pair.slave and kind_of(data) == Kind.WELCOME]
        asked = pair.slave.of(StopAsked)
        assert asked == [StopAsked("pedal")] * len(asked) and len(answers) >= 4


def test_a_stop_gets_through_while_another_drives_with_another_file() -> None:
    pair = driven()
    pair._on_tick = close_when_asked
    at = pair.now
    pedal = pair.join(**caller(Right.STOP, Right.STOP, **FILES_DIFFER))
    while not pedal.of(Told):
        pair.run(0.001)
        assert pair.now < at + 0.1
    pair.run(0.01)
    assert pair.master.of(PeerClosed) == [PeerClosed("stopped")]


def test_no_recorded_call_stops_a_later_run_of_the_robot() -> None:
    pair = pair_of(Right.STOP, Right.STOP, on_tick=close_when_asked).run(0.3)
    recorded = sent(pair, Kind.HELLO, pair.master)
    assert pair.slave.of(StopAsked) and len(recorded) >= 2
    later = make_endpoint(Role.RESPONDER, seed=9, name="arm", security=Keyring(HELD))
    later.connect(0.0)
    for number, data in enumerate(recorded * 3):
        later.receive_datagram(data, MASTER, 0.2 * number)
    events = [later.next_event() for _ in range(100)]
    assert not any(isinstance(event, StopAsked) for event in events) and later.state is State.LISTENING


def withdrawn(pair: Pair, keys: list[HeldKey]) -> Endpoint:
    """The robot's end, which holds other keys from now on."""
    slave = pair.slave.endpoint
    slave._end.security.replace(keys)  # type: ignore[attr-defined]
    slave.check_keys(pair.slave.local(pair.now))
    pair.flush(pair.slave)
    return slave


@pytest.mark.parametrize(
    "left", [[], HELD[1:], [HELD[0]._replace(right=Right.WATCH)], [HELD[0]._replace(key=bytes(32))]]
)
def test_a_key_that_is_withdrawn_ends_the_session_and_opens_none(left: list[HeldKey]) -> None:
    pair = driven()
    slave = withdrawn(pair, left)
    assert slave.state is State.LISTENING
    pair.run(0.01)
    assert pair.slave.of(PeerClosed) == [PeerClosed(WITHDRAWN)]
    assert pair.master.refusal() == WITHDRAWN and pair.master.endpoint.state is State.CLOSED
    again = pair.join(**caller(Right.DRIVE, Right.DRIVE))
    pair.run(1.0)
    assert again.endpoint.state is not State.ENGAGED and slave.sessions == 1 and not again.of(Connected)


def test_a_call_under_a_key_that_was_withdrawn_meanwhile_becomes_no_session() -> None:
    pair = pair_of(Right.DRIVE, Right.DRIVE)
    while not sent(pair, Kind.WELCOME):
        pair.run(0.0005)
    slave = withdrawn(pair, HELD[1:])
    pair.run(1.0)
    assert slave.sessions == 0 and not pair.slave.of(Connected)


def test_other_keys_that_change_do_not_disturb_a_session() -> None:
    pair = driven()
    slave = withdrawn(pair, [HELD[0], HeldKey(bytes(32), Right.DRIVE, "new@desk")])
    pair.run(0.5)
    assert states(pair) == ENGAGED and slave.sessions == 1 and not pair.master.of(Refused | PeerClosed)  # type: ignore[arg-type]


BOB = HeldKey(Random("bob@desk").randbytes(32), name="bob@desk")
OWN, OF_ANY = [HELD[0], BOB], [*HELD[1:], HeldKey(KEYS[Right.DRIVE])]


@pytest.mark.parametrize(
    ("held", "name", "key", "is_served"),
    [
        (OWN, "ann@desk", KEYS[Right.DRIVE], True), (OWN, "bob@desk", BOB.key, True),
        (OWN, "bob@desk", KEYS[Right.DRIVE], False), (OWN, "ann@desk", bytes(32), False),
        (OWN, "eve@desk", bytes(32), False), (OWN, "eve@desk", KEYS[Right.DRIVE], False),
        (OF_ANY, "zoe@desk", KEYS[Right.DRIVE], True), (OF_ANY, "pedal", KEYS[Right.DRIVE], False),
        (OF_ANY, "zoe@desk", KEYS[Right.STOP], False),
    ],
)  # fmt: skip
def test_a_key_serves_its_name_alone_and_one_without_a_name_all_that_have_none(
    held: list[HeldKey], name: str, key: bytes, is_served: bool
) -> None:
    ends = {"name": name, "security": PresharedKey(key)}
    pair = Pair(master=ends, slave={"name": "robot", "security": Keyring(held)}).connect().run(0.5)
    assert bool(pair.slave.of(Connected)) is bool(pair.master.of(Connected)) is is_served
    assert not is_served or pair.slave.endpoint.peer_name == name
    assert is_served or (set(pair.slave.faults()) == {DropReason.UNPROVEN} and not pair.master.of(Refused))
