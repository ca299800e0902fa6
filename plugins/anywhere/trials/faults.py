"""Paths that fail while a hand presses on a remote surface."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic, sleep

import numpy as np

from plugins.anywhere.tests.testbed import CONE, FIRST, SECOND, SYMMETRIC, Router
from plugins.anywhere.trials.interruption import EITHER, NOTHING, SILENCE, Interruption, measure, violated
from plugins.anywhere.trials.scene import FILE, MEET_S, SCRIPT, Scene, scene, waits
from tests.program import ENGAGED
from trials.rig import Side, within
from weberlink.system.configuration import MASTER, SLAVE, load

BACK_S = 30.0
"""From the end of a fault until a session [s]."""
CONTACT_N = 0.3
Deed = Callable[[Scene], object]


@dataclass(frozen=True)
class Fault:
    """What fails, for `lasts` [s].

    Args:
        begin, end: do it and undo it.
        effect: what it must lead to.
        robot, operator: kinds of NAT.
        second: kind of NAT of the operator's second interface.
        settings: of both commands, as of `--set`.
        after_s: from the end of the fault until what it did is looked at, if the session lasts.
    """

    meaning: str
    begin: Deed
    end: Deed = lambda _: None
    lasts: float = 0.0
    effect: str = SILENCE
    robot: str = CONE
    operator: str = CONE
    second: str | None = None
    settings: tuple[str, ...] = ()
    after_s: float = 3.0


def first(place: Scene) -> Router:
    return place.operator.home.first


def unplug(place: Scene) -> None:
    first(place).unplug()


def plug(place: Scene) -> None:
    first(place).connect_host()


def darken(place: Scene) -> None:
    first(place).set_silent(True)


def lighten(place: Scene) -> None:
    first(place).set_silent(False)


def forget(place: Scene) -> None:
    first(place).forget()


RELAYED = {"robot": SYMMETRIC, "operator": SYMMETRIC}
TWO = ("link.finder.paths=2", f"link.finder.interfaces=[{FIRST},{SECOND}]")
FAULTS: Mapping[str, Fault] = {
    "cut": Fault("operator's interface down", unplug, plug, lasts=2.0),
    "cut-robot": Fault(
        "robot's interface down",
        lambda s: s.robot.home.first.unplug(),
        lambda s: s.robot.home.first.connect_host(),
        lasts=2.0,
    ),
    "cut-one": Fault("one of two down", unplug, plug, lasts=2.0, effect=NOTHING, second=CONE, settings=TWO),
    "moved": Fault("Wi-Fi down, phone stays (1 path)", unplug, second=CONE, settings=("link.finder.paths=1",)),
    "dark": Fault("router passes nothing", darken, lighten, lasts=2.0),
    "blink": Fault("the same, for 50 ms", darken, lighten, lasts=0.05, effect=EITHER),
    "forget": Fault("cone NAT loses its mappings", forget, effect=EITHER),
    "forget-relay": Fault("symmetric NAT loses its mappings", forget, effect=EITHER, **RELAYED),
    "timeout": Fault("unused mappings live for 1 s", lambda s: first(s).set_timeout(1), lasts=4.0, effect=NOTHING),
    "address": Fault("operator's address changes", lambda s: first(s).readdress(), effect=EITHER),
    "renumber": Fault("router's address changes", lambda s: first(s).renumber(), effect=EITHER),
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
    with (
        scene(fault.robot, fault.operator, second=fault.second) as place,
        place.robot.command(SLAVE, *words) as robot,
    ):
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
            found = measure(operator.records, robot.records, failed, restored, loaded)
            return found, violated(found, loaded, fault.effect)


def is_in_contact(operator: Side) -> bool:
    """Whether there was force on the hand for the last 0.3 s, in a session."""
    last = operator.records[-300:]
    forces = np.linalg.norm(last["output"], axis=1)
    return len(last) == 300 and bool((forces > CONTACT_N).all() and (last["state"] == ENGAGED).all())


def are_engaged(*sides: Side) -> bool:
    return all(len(side.records) and side.records["state"][-1] == ENGAGED for side in sides)
