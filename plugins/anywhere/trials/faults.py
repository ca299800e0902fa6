"""Paths that fail while a hand presses on a remote surface, and which promises of docs/safety.md were broken.

Both daemons run on this machine, so their records have one clock. `trials.safety` judges ramp, approach and retreat in
virtual time; here a tick may be late, as the host is.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic, sleep
from typing import Any

import numpy as np

from plugins.anywhere.tests.namespaces import SERVER
from plugins.anywhere.tests.testbed import CONE, FIRST, SECOND, SYMMETRIC, Router
from plugins.anywhere.trials.scene import FILE, MEET_S, SCRIPT, Scene, scene, waits
from tests.program import ENGAGED, Records
from trials.rig import Side, within
from trials.safety.run import STILL, WALL_M_S
from weberlink.config import MASTER, SLAVE, Configuration, load
from weberlink.telemetry.fault import Fault as Named

BACK_S = 30.0  # from the end of a fault until a session [s]
CONTACT_N = 0.3
STALL_S = 0.03  # by which a busy machine may delay a tick that reads what has arrived [s]
SILENCE, NOTHING, EITHER = "silence", "nothing", "either"
Deed = Callable[[Scene], object]


@dataclass(frozen=True)
class Fault:
    """What fails, for `lasts` [s]."""

    meaning: str
    begin: Deed  # do it and undo it
    end: Deed = lambda _: None
    lasts: float = 0.0
    effect: str = SILENCE  # what it must lead to
    robot: str = CONE  # kinds of NAT
    operator: str = CONE
    second: str | None = None  # kind of NAT of the operator's second interface
    settings: tuple[str, ...] = ()  # of both commands, as of `--set`
    after_s: float = 3.0  # from the end of the fault until what it did is looked at, if the session lasts


def unplug(router: Router) -> None:
    router.host.ip(f"link set {router.interface} down")


def readdress(router: Router) -> None:
    before = router.address
    base, last = before.rsplit(".", 1)
    router.address = f"{base}.{int(last) + 1}"
    router.host.ip(f"addr del {before}/{router.size} dev {router.interface}")
    router.connect_host()


def renumber(router: Router) -> None:
    """Give a router with NAT another public address, as a provider may; all mappings are lost."""
    before, router.outside = router.outside, f"203.0.113.{int(router.outside.rsplit('.', 1)[1]) + 100}"
    router.space.ip(f"addr del {before}/24 dev outside", f"addr add {router.outside}/24 dev outside", DEFAULT)
    router.space.forget_connections()


def shorten(router: Router) -> None:
    for kind in ("timeout", "timeout_stream"):
        router.space.set_sysctl(f"netfilter/nf_conntrack_udp_{kind}", 1)


def at_operator(deed: Callable[[Router], object]) -> Deed:
    return lambda place: deed(place.operator.home.first)


DEFAULT = f"route replace default via {SERVER}"
UNPLUG, PLUG = at_operator(unplug), at_operator(Router.connect_host)
DARKEN = at_operator(lambda router: router.space.ip("link set outside down"))  # no sign of it at the host
LIGHTEN = at_operator(lambda router: router.space.ip("link set outside up", DEFAULT))
FORGET = at_operator(lambda router: router.space.forget_connections())
RELAYED = {"robot": SYMMETRIC, "operator": SYMMETRIC}
TWO = ("link.finder.paths=2", f"link.finder.interfaces=[{FIRST},{SECOND}]")
FAULTS: Mapping[str, Fault] = {
    "cut": Fault("operator's interface down", UNPLUG, PLUG, lasts=2.0),
    "cut-robot": Fault(
        "robot's interface down",
        lambda s: unplug(s.robot.home.first),
        lambda s: s.robot.home.first.connect_host(),
        lasts=2.0,
    ),
    "cut-one": Fault("one of two down", UNPLUG, PLUG, lasts=2.0, effect=NOTHING, second=CONE, settings=TWO),
    "moved": Fault("Wi-Fi down, phone stays (1 path)", UNPLUG, second=CONE, settings=("link.finder.paths=1",)),
    "dark": Fault("router passes nothing", DARKEN, LIGHTEN, lasts=2.0),
    "blink": Fault("the same, for 50 ms", DARKEN, LIGHTEN, lasts=0.05, effect=EITHER),
    "forget": Fault("cone NAT loses its mappings", FORGET, effect=EITHER),
    "forget-relay": Fault("symmetric NAT loses its mappings", FORGET, effect=EITHER, **RELAYED),
    "timeout": Fault("unused mappings live for 1 s", at_operator(shorten), lasts=4.0, effect=NOTHING),
    "address": Fault("operator's address changes", at_operator(readdress), effect=EITHER),
    "renumber": Fault("router's address changes", at_operator(renumber), effect=EITHER),
    "relay": Fault(
        "relay killed and restarted", lambda s: s.relay.stop(), lambda s: s.relay.start(), lasts=2.0, **RELAYED
    ),
    "mailbox": Fault(
        "mailbox gone", lambda s: s.mailbox.stop(), lambda s: s.mailbox.start(), lasts=5.0, effect=NOTHING
    ),
}


def inflict(fault: Fault) -> tuple["Interruption | None", list[str]]:
    """Start a session, wait for contact, do the fault and undo it; the figures, and what was broken."""
    words = [word for each in fault.settings for word in ("--set", each)]
    with scene(fault.robot, fault.operator, second=fault.second) as place, place.robot.command(SLAVE, *words) as robot:
        if not waits(robot):
            return None, [f"no slave: {robot.last_line}"]
        with place.operator.command(MASTER, *words, "--set", SCRIPT) as operator:
            if operator.first_engaged(MEET_S) is None:
                return None, [f"no session: {operator.last_line}"]
            if within(MEET_S, lambda: is_in_contact(operator)) is None:
                return None, ["no contact"]
            failed = monotonic()
            fault.begin(place)
            sleep(fault.lasts)
            fault.end(place)
            restored = monotonic()
            within(BACK_S, lambda: monotonic() > restored + fault.after_s and operator.is_engaged and robot.is_engaged)
            sleep(1.0)
            loaded = load(place.operator.folder / FILE, (*fault.settings, SCRIPT), [MASTER])
            found = measure(operator.records, robot.records, failed, restored)
            return found, violated(found, loaded, fault.effect)


def is_in_contact(operator: Side) -> bool:
    last = operator.records[-300:]
    forces = np.linalg.norm(last["output"], axis=1)
    return len(last) == 300 and bool((forces > CONTACT_N).all() and (last["state"] == ENGAGED).all())


@dataclass(frozen=True)
class Interruption:
    away_ms: float  # how long hand or robot were without a session
    back_ms: float | None  # from the end of the fault until both are in a session again; None if they are not
    # from the last datagram that a side heard to its last tick with force on the hand, or of the session in which the
    # robot moved
    force_ms: float
    robot_ms: float
    step_n: float  # largest change of force on the hand for each tick that passed, from the fault on
    faults: tuple[tuple[str, ...], ...]  # named by master and slave


def measure(master: Records, slave: Records, failed: float, restored: float) -> Interruption:
    gone = [side["at"][(side["at"] >= failed) & (side["state"] != ENGAGED)] for side in (master, slave)]
    is_back = master["state"][-1] == slave["state"][-1] == ENGAGED
    force = np.linalg.norm(master["output"], axis=1)
    moved = np.abs(np.diff(slave["output"], axis=0, prepend=slave["output"][:1])).max(axis=1)
    steps = np.abs(np.diff(force)) / np.diff(master["tick"].astype(np.int64))
    since = (side["fault"][side["at"] >= failed] for side in (master, slave))
    return Interruption(
        away_ms=1e3 * max(float(np.ptp(each)) if len(each) else 0.0 for each in gone),
        back_ms=1e3 * max((float(each[-1]) - restored for each in gone if len(each)), default=0.0) if is_back else None,
        force_ms=_acted_for(master, gone[0], force > STILL),
        robot_ms=_acted_for(slave, gone[1], (moved > STILL) & (slave["state"] == ENGAGED)),
        step_n=float(steps[master["at"][1:] >= failed].max()),
        faults=tuple(tuple(sorted(Named(value).name.lower() for value in {*each.tolist()} - {0})) for each in since),
    )


def _acted_for(records: Records, gone: Any, acts: Any) -> float:
    """From the last datagram before the silence to the last of these ticks before the session is back [ms]."""
    if not len(gone):
        return 0.0
    at, heard = records["at"], np.diff(records["datagrams_received"].astype(np.int64), prepend=0) > 0
    last = at[heard & (at < gone[0])][-1]
    back = at[(at > gone[0]) & (records["state"] == ENGAGED)]
    acting = at[acts & (at > last) & (at < (back[0] if len(back) else np.inf))]
    return 1e3 * float(acting[-1] - last) if len(acting) else 0.0


def violated(found: Interruption, loaded: Configuration, effect: str) -> list[str]:
    """The promises that a run has broken; `effect` is what the fault must lead to: SILENCE, NOTHING, or EITHER."""
    tick = loaded.system.tick_period
    most_ms = loaded.system.link.silence_ms + 1e3 * (tick + STALL_S)
    assert loaded.device is not None
    wall_n = loaded.device.options.stiffness_n_m * WALL_M_S * tick  # type: ignore[attr-defined]
    is_silence = effect == SILENCE
    laws = (
        ("without a session, which was not due [ms]", found.away_ms, 0.0, effect == NOTHING),
        ("the fault had no effect, so nothing was shown", float(not found.away_ms), 0.0, is_silence),
        ("no session after the fault", float(found.back_ms is None), 0.0, True),
        ("force was on the hand after the last datagram for [ms]", found.force_ms, most_ms, is_silence),
        ("the robot moved after the last datagram for [ms]", found.robot_ms, most_ms, is_silence),
        ("change of the force in a tick [N]", found.step_n, wall_n * (1.0 + 1e-9), True),
        ("an end named no fault", float(not all(found.faults)), 0.0, is_silence),
    )
    return [f"{law}: {figure:.4g}, {most:.4g} allowed" for law, figure, most, holds in laws if holds and figure > most]
