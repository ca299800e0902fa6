"""Paths that fail while a hand presses on a remote surface."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic, sleep

import numpy as np

from plugins.anywhere.tests.namespaces import SERVER
from plugins.anywhere.tests.testbed import CONE, FIRST, SECOND, SYMMETRIC, Router
from plugins.anywhere.trials.interruption import EITHER, NOTHING, SILENCE, Interruption, measure, violated
from plugins.anywhere.trials.scene import FILE, MEET_S, SCRIPT, Scene, scene, waits
from tests.program import ENGAGED
from trials.rig import Side, within
from weberlink.config import MASTER, SLAVE, load

BACK_S = 30.0  # from the end of a fault until a session [s]
CONTACT_N = 0.3
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
    """Take the host's interface down."""
    router.host.ip(f"link set {router.interface} down")


def readdress(router: Router) -> None:
    """Give the host another address in its net, as a DHCP server may."""
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
    """Unused mappings live for a second."""
    for kind in ("timeout", "timeout_stream"):
        router.space.set_sysctl(f"netfilter/nf_conntrack_udp_{kind}", 1)


def at_operator(deed: Callable[[Router], object]) -> Deed:
    return lambda place: deed(place.operator.home.first)


def at_robot(deed: Callable[[Router], object]) -> Deed:
    return lambda place: deed(place.robot.home.first)


DEFAULT = f"route replace default via {SERVER}"
UNPLUG, PLUG = at_operator(unplug), at_operator(Router.connect_host)
DARKEN = at_operator(lambda router: router.space.ip("link set outside down"))  # no sign of it at the host
LIGHTEN = at_operator(lambda router: router.space.ip("link set outside up", DEFAULT))
FORGET = at_operator(lambda router: router.space.forget_connections())
RELAYED = {"robot": SYMMETRIC, "operator": SYMMETRIC}
TWO = ("link.finder.paths=2", f"link.finder.interfaces=[{FIRST},{SECOND}]")
FAULTS: Mapping[str, Fault] = {
    "cut": Fault("operator's interface down", UNPLUG, PLUG, lasts=2.0),
    "cut-robot": Fault("robot's interface down", at_robot(unplug), at_robot(Router.connect_host), lasts=2.0),
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


def inflict(fault: Fault) -> tuple[Interruption | None, list[str]]:
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
            within(BACK_S, lambda: monotonic() > restored + fault.after_s and are_engaged(operator, robot))
            sleep(1.0)
            loaded = load(place.operator.folder / FILE, (*fault.settings, SCRIPT), [MASTER])
            found = measure(operator.records, robot.records, failed, restored)
            return found, violated(found, loaded, fault.effect)


def is_in_contact(operator: Side) -> bool:
    """Whether there was force on the hand for the last 0.3 s, in a session."""
    last = operator.records[-300:]
    forces = np.linalg.norm(last["output"], axis=1)
    return len(last) == 300 and bool((forces > CONTACT_N).all() and (last["state"] == ENGAGED).all())


def are_engaged(*sides: Side) -> bool:
    return all(len(side.records) and side.records["state"][-1] == ENGAGED for side in sides)
